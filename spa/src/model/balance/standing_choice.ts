import { type BalanceRule, readBalance, type Schema } from '@posecast/wire';
import type { BalanceGap } from '../../twin/balance/balance.ts';
import { FootWrenchReader } from '../../twin/balance/foot_wrench.ts';
import type { Foot, FootSensor, SolePlane, Standing } from '../../twin/balance/standing.ts';
import { toldOfMasses } from '../../twin/balance/told/mass_findings.ts';
import { quatOfRpy, rotateVector, type Vec3 } from '../../twin/rotation.ts';
import { Kinematics } from '../kinematics.ts';
import type { Manifest } from '../manifest.ts';
import { addScaled, dot, originOf, pointBefore, pointThrough } from '../vectors.ts';
import { type LinkMass, readMasses, readSoles, type Sole } from './masses_and_soles.ts';
import { planeOfSole } from './sole_plane.ts';

const AXES: FootSensor['axes'] = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
const NO_RULE: BalanceRule = { feet: null, ground: null, soles: new Map() };

/**
 * Finds what a robot's masses are and what it stands on (docs/explanation/balance.md). Feet are, in this order:
 *
 * 1. those of the profile: sites of wrench sensors, else links; a link has the sensor that is mounted on it or on what is
 *    fixed to it. `[]` are none. Each has the profile's sole, else the model's.
 * 2. the wrench sensors on a link with a sole (or on what is fixed to it), if they are at least two;
 * 3. with fewer such sensors, the model's soles, if they are at least two.
 *
 * A foot that is named but not there, or whose sole can't be one, or that is another one under a second name, is left out;
 * with ground `measured` no feet are known then.
 *
 * Which of them bear is `measured` when the profile says so, else in 1 when every foot has a sensor of the force along
 * its normal, and in 2; all else is `lowest`.
 */
export function chooseStanding(manifest: Manifest, schema: Schema): Standing {
  const problems: string[] = [];
  const attempt = <T>(read: () => T, otherwise: T): T => {
    try {
      return read();
    } catch (error) {
      problems.push(error instanceof Error ? error.message : String(error));
      return otherwise;
    }
  };
  // A bundle that can't be read is as good as one without: building it again is what helps.
  const known = attempt(() => readMasses(manifest), null);
  const soles = attempt(() => readSoles(manifest), null);
  const rule = attempt(() => readBalance(schema), NO_RULE);
  const lacks: string[] = [];
  const found = findFeet(manifest, schema, soles ?? [], rule, lacks);
  problems.push(...new Set(lacks));
  const measured = found.every(({ sensor }) => sensor?.measuresForce ?? false) ? 'measured' : 'lowest';
  const ground = rule.ground ?? measured;
  // Without a foot that may bear, the margin is of what the robot does not stand on.
  const feet = lacks.length > 0 && ground === 'measured' ? [] : found;
  return {
    masses: known ?? [],
    massGap: whyNoMasses(known, manifest),
    feet,
    footGap: feet.length === 0 ? whyNoFeet(soles, rule, manifest) : null,
    ground: feet.length === 0 ? null : ground,
    problems,
  };
}

function whyNoFeet(soles: readonly Sole[] | null, rule: BalanceRule, { raw }: Manifest): BalanceGap {
  if (soles !== null || rule.feet?.length === 0) return 'no-feet';
  return raw.v === 1 ? 'raw' : 'old-bundle';
}

function whyNoMasses(masses: readonly LinkMass[] | null, { raw }: Manifest): BalanceGap | null {
  if (masses === null) return 'old-bundle';
  if (masses.length > 0) return null;
  const listed = Array.isArray(raw.inertials) && raw.inertials.length > 0;
  return listed || toldOfMasses(raw.findings).length > 0 ? 'impossible-masses' : 'no-masses';
}

/** A sensor of the mapping that measures at least one component of a wrench, on a link of the model. */
interface Mounted {
  readonly site: string;
  readonly link: number;
  readonly xyz: Vec3;
  readonly rpy: Vec3;
  readonly forceAxes: readonly number[];
  readonly momentAxes: readonly number[];
}

/** `lacks` gets a line for each foot that is left out. */
function findFeet(
  { links, joints }: Manifest,
  schema: Schema,
  soles: readonly Sole[],
  rule: BalanceRule,
  lacks: string[],
): readonly Foot[] {
  /** For each link the first link of those that are fixed to each other. */
  const groups = [0];
  for (const { type, parent } of joints) groups.push(type === 'fixed' ? groups[parent]! : groups.length);
  const isFixedTo = (link: number) => (one: { readonly link: number }) => groups[one.link] === groups[link];
  const soleOn = (link: number) => soles.find((sole) => sole.link === link) ?? soles.find(isFixedTo(link));
  const { rootFromLink } = new Kinematics(joints);
  const at = (link: number) => rootFromLink.subarray(link * 16, link * 16 + 16);
  /** The mean of the links' origins, which is on the inside of any sole. */
  const body = links.reduce<Vec3>(
    (sum, _, link) => addScaled(sum, originOf(at(link)), 1 / links.length),
    [0, 0, 0],
  );
  const mounts = schema.mapping.sensors;
  const sensors = new FootWrenchReader(schema, mounts.keys()).wrenches.flatMap(
    ({ site, force, moment }): Mounted[] => {
      const mount = mounts.get(site)!;
      const link = links.indexOf(mount.link ?? '');
      return link < 0 ? [] : [{ ...mount, site, link, forceAxes: force.axes, momentAxes: moment.axes }];
    },
  );

  /** A foot with the profile's sole, else the model's. None when there is no such link, or no sole that can be one. */
  const foot = (name: string, link: number, points: readonly Vec3[] = [], mounted?: Mounted): Foot[] => {
    const sole = link < 0 ? null : planeOfSole(rule.soles.get(name) ?? points, pointBefore(at(link), body));
    if (sole === null) {
      lacks.push(`[balance] ${name} has no sole, or one that can't be`);
      return [];
    }
    const sensor = mounted === undefined ? null : sensorFrom(at(link), at(mounted.link), sole, mounted);
    return [{ name, link, linkName: links[link]!, sole, sensor }];
  };

  if (rule.feet !== null) {
    const named = rule.feet.flatMap((name) => {
      const own = sensors.find(({ site }) => site === name);
      const link = own?.link ?? links.indexOf(name);
      const sole = soleOn(link);
      const on = rule.soles.has(name) ? link : (sole?.link ?? -1);
      return foot(name, on, sole?.points, own ?? sensors.find(isFixedTo(link)));
    });
    return withoutTwins(named, lacks);
  }
  const taken = new Set<number>();
  const measured = sensors.flatMap((sensor) => {
    const sole = soleOn(sensor.link);
    if (sole === undefined || taken.has(sole.link)) return [];
    taken.add(sole.link);
    return foot(sensor.site, sole.link, sole.points, sensor);
  });
  if (measured.length > 1) return measured;
  const assumed = soles.flatMap(({ link, points }) => foot(links[link]!, link, points));
  return assumed.length > 1 ? assumed : [];
}

/** Feet of one sole or one sensor are one foot under two names, whose force would count twice. */
function withoutTwins(feet: readonly Foot[], lacks: string[]): readonly Foot[] {
  const kept: Foot[] = [];
  for (const foot of feet) {
    const twin = kept.find(
      ({ link, sensor }) => link === foot.link || (sensor !== null && sensor.site === foot.sensor?.site),
    );
    if (twin === undefined) kept.push(foot);
    else lacks.push(`[balance] ${twin.name} and ${foot.name} are one foot`);
  }
  return kept;
}

/** A sensor seen from the link with the sole (`rootFromSole`), to which its own is fixed (`rootFromMount`). */
function sensorFrom(
  rootFromSole: Float64Array,
  rootFromMount: Float64Array,
  sole: SolePlane,
  { site, xyz: mounted, rpy, forceAxes, momentAxes }: Mounted,
): FootSensor {
  const seen = (point: Vec3) => pointBefore(rootFromSole, pointThrough(rootFromMount, point));
  const xyz = seen(mounted);
  const axes = AXES.map((axis) =>
    addScaled(seen(addScaled(mounted, rotateVector(quatOfRpy(rpy), axis))), xyz, -1),
  ) as unknown as FootSensor['axes'];
  const along = axes.map((axis) => Math.abs(dot(axis, sole.normal)));
  const nearest = along.indexOf(Math.max(...along));
  const measuresForce = forceAxes.includes(nearest);
  const measuresMoments = [0, 1, 2].every((axis) => axis === nearest || momentAxes.includes(axis));
  return { site, xyz, axes, measuresForce, measuresPressure: measuresForce && measuresMoments };
}
