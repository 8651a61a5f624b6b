import { type BalanceRule, readBalance, type Schema } from '@posecast/wire';
import type { BalanceGap, Foot, FootSensor, SolePlane, Standing, Vec2 } from '../../twin/balance/balance.ts';
import { FootWrenchReader } from '../../twin/balance/foot_wrench.ts';
import { toldOfMasses } from '../../twin/balance/lacks.ts';
import { convexHull } from '../../twin/balance/polygon.ts';
import { quatOfRpy, rotateVector, type Vec3 } from '../../twin/rotation.ts';
import { Kinematics } from '../kinematics.ts';
import type { Manifest } from '../manifest.ts';
import { addScaled, cross, dot, normalize, originOf, pointBefore, pointThrough, scale } from '../vectors.ts';
import { type LinkMass, readMasses, readSoles, type Sole } from './masses_and_soles.ts';

/** Two directions with a smaller sine between them count as equal. */
const PARALLEL = 1e-6;
/** A corner of a foot can't be farther than this (metres) from the frame's origin along an axis. */
const REACH_M = 10;
/** The corners of a sole can't be farther than this (metres) from its plane. */
const FLAT_M = 0.01;

/**
 * The plane of a sole, from points in any order. They may be a centimetre off their plane, and need not be a convex polygon: the
 * plane is that of the largest triangle with their mean and the point farthest from it. `body` is a point on the inside of that
 * plane, in the same frame. null if the points span no area or can't be a sole: beyond 10 m, or not flat.
 */
export function planeOfSole(points: readonly Vec3[], body: Vec3): SolePlane | null {
  if (points.length < 3 || !points.flat().every((x) => Math.abs(x) <= REACH_M)) return null;
  const centre = meanOf(points);
  const arms = points.map((point) => addScaled(point, centre, -1));
  const far = longest(arms);
  const widest = longest(arms.map((arm) => cross(far, arm)));
  if (Math.hypot(...widest) <= PARALLEL * dot(far, far)) return null;
  const normal = scale(normalize(widest), dot(widest, addScaled(body, centre, -1)) < 0 ? -1 : 1);
  if (arms.some((arm) => Math.abs(dot(arm, normal)) > FLAT_M)) return null;
  const across = normalize(far);
  const along = cross(normal, across);
  const flat = arms.map((arm): Vec2 => [dot(arm, across), dot(arm, along)]);
  const corners = convexHull(flat).map((i) => points[i]!);
  return { corners, normal, centre: meanOf(corners) };
}

function meanOf(points: readonly Vec3[]): Vec3 {
  return scale(points.reduce(sumOf), 1 / points.length);
}

function longest(vectors: readonly Vec3[]): Vec3 {
  return vectors.reduce((most, one) => (dot(one, one) > dot(most, most) ? one : most));
}

function sumOf(a: Vec3, b: Vec3): Vec3 {
  return addScaled(a, b);
}

const AXES: FootSensor['axes'] = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
const NO_RULE: BalanceRule = { feet: null, ground: null, soles: new Map() };

/**
 * Finds a robot's masses and feet (docs/explanation/balance.md). Feet are, in this order:
 *
 * 1. those in the profile: sites of wrench sensors, or links; a link uses the sensor mounted on it or on a link fixed to it. `[]`
 *   means no feet. Each has the profile's sole, else the model's.
 * 2. the wrench sensors on a link with a sole (or on a link fixed to it), if there are at least two;
 * 3. with fewer such sensors, the model's soles, if there are at least two.
 *
 * A foot is left out if it does not exist, if its sole is invalid, or if it duplicates another foot. With ground `measured`, no
 * feet are then known.
 *
 * Contact is `measured` if the profile says so. Otherwise it is `measured` in case 1 if every foot has a sensor for the force
 * along its normal, and in case 2; in all other cases it is `lowest`.
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
  // An unreadable bundle is treated like a missing one: rebuilding it fixes both.
  const known = attempt(() => readMasses(manifest), null);
  const soles = attempt(() => readSoles(manifest), null);
  const rule = attempt(() => readBalance(schema), NO_RULE);
  const lacks: string[] = [];
  const found = findFeet(manifest, schema, soles ?? [], rule, lacks);
  problems.push(...new Set(lacks));
  const measured = found.every(({ sensor }) => sensor?.measuresForce ?? false) ? 'measured' : 'lowest';
  const ground = rule.ground ?? measured;
  // If a foot that may bear weight were missing, the margin would be computed for the wrong support.
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

/** A sensor in the mapping that measures at least one component of a wrench, on a link of the model. */
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
  /** For each link, the first link of its rigidly connected group. */
  const groups = [0];
  for (const { type, parent } of joints) groups.push(type === 'fixed' ? groups[parent]! : groups.length);
  const isFixedTo = (link: number) => (one: { readonly link: number }) => groups[one.link] === groups[link];
  const soleOn = (link: number) => soles.find((sole) => sole.link === link) ?? soles.find(isFixedTo(link));
  const { rootFromLink } = new Kinematics(joints);
  const at = (link: number) => rootFromLink.subarray(link * 16, link * 16 + 16);
  /** The mean of the links' origins, which is on the inner side of any sole. */
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

  /** A foot with the profile's sole, else the model's. Null if the link does not exist or has no valid sole. */
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

/** Two feet with the same sole or sensor are one foot under two names; its force would count twice. */
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

/** A sensor relative to the link with the sole (`rootFromSole`), to which the sensor's link is fixed (`rootFromMount`). */
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
