import { emptyBox, expandByBox } from '../model/bounds.ts';
import { transform } from '../model/kinematics.ts';
import { pointThrough, quatOfRpy } from '../model/vectors.ts';
import { boxOf, type Facts, longestSide, poseOf, robotBox, zeroPoses } from './doctor_meshes.ts';
import { distrustsMasses, type Finding, general, NO_BALANCE, quoted } from './finding.ts';
import type { Tree } from './tree.ts';
import type { Inertial, Link } from './types.ts';

/**
 * Finds implausible masses, and returns the others in the manifest's form (docs/reference/model-bundle.md). Rules and wording are
 * those of `posecast-edge doctor` (posecast_edge.model.doctor.masses).
 */

const DENSITY_MAX = 12_000; // kg/m³
const BOX_MIN_M3 = 1e-6;
const MASS_MAX_KG = 1e6;
/** For a robot. */
const MASS_MIN_KG = 1e-3;
const REACH_M = 100;
/** Fraction of the robot's mass, or of the boxes of all links: anything below is only a hint. */
const HEAVY_SHARE = 0.25;
const MOMENTS_SHARE = 0.1;
const EMPTY_SHARE = 0.02;
/** Fractions of the largest moment: how far the sum of the others may fall short of it, and beyond which rounding is no
 *  explanation. */
const SLACK = 0.01;
const GROSS = 0.5;
const SPAN_M = 1e-3;
/** Fraction of the largest number in a matrix: what may remain of a moment of 0. */
const NOISE = 1e-6;
/** Maximum names in one line. */
const SHOWN = 6;

type Problem = readonly [code: string, text: string];

/** Each link in the tree with an implausible mass, centre or moment. `facts`: about the meshes; null before they are read. */
export function massFindings(tree: Tree, facts: Facts | null): Finding[] {
  const links = linksOf(tree);
  const held = heldLinks(tree, links);
  const boxes = links.map((link) => (facts === null ? null : boxVolume(link, facts)));
  let [whole, shown] = [0, 0];
  for (const { inertial } of links) whole += Math.max(inertial?.mass ?? 0, 0);
  for (const box of boxes) shown += box ?? 0;
  const found = links.flatMap((link, i): Finding[] => {
    const { name, inertial } = link;
    if (inertial === null) return [];
    const box = boxes[i] ?? null;
    const share = Math.max(inertial.mass, 0) / (whole || 1);
    const empty = () => (held.has(name) ? null : emptiness(link, (box ?? 0) / (shown || 1)));
    const found =
      inertial.mass === 0
        ? empty()
        : (extreme(inertial) ?? heavy(inertial.mass, box, share) ?? impossible(inertial, share));
    if (found === null) return [];
    const [code, text] = found;
    const distrusted = distrustsMasses({ code });
    const told = `link ${quoted(name)}: ${text}${distrusted ? `; ${NO_BALANCE}` : ''}`;
    return [{ severity: distrusted ? 'warning' : 'hint', code, text: told, line: inertial.line }];
  });
  if (whole > 0) found.push(...wholeFindings(links, held, whole));
  if (facts !== null) found.push(...centreFindings(tree, links, facts));
  return found;
}

function wholeFindings(links: readonly Link[], held: ReadonlySet<string>, whole: number): Finding[] {
  const found: Finding[] = [];
  if (whole < MASS_MIN_KG) {
    const text = `the total mass is ${general(whole, 3)} kg; ${NO_BALANCE}`;
    const { line = null } = links.find(({ inertial }) => inertial !== null)?.inertial ?? {};
    found.push({ severity: 'warning', code: 'mass-light', text, line });
  }
  const bare = links.filter((link) => link.inertial === null && !held.has(link.name) && shows(link));
  if (bare.length > 0) {
    const more = bare.length > SHOWN ? ` and ${bare.length - SHOWN} more` : '';
    const have = bare.length > 1 ? 'links with shells have' : 'link with shells has';
    const names = bare.slice(0, SHOWN).map(({ name }) => quoted(name));
    const text = `${bare.length} ${have} no mass: ${names.join(', ')}${more}`;
    found.push({ severity: 'hint', code: 'unweighed', text, line: bare[0]!.line });
  }
  return found;
}

/** Centres farther outside the robot than its size, with all joints at 0; none if the size is unknown. */
function centreFindings(tree: Tree, links: readonly Link[], facts: Facts): Finding[] {
  const shapes = links.flatMap(({ visuals }) => visuals.map(({ shape }) => shape));
  if (shapes.length === 0 || shapes.some((shape) => shape === null || boxOf(shape, facts) === null))
    return [];
  const whole = robotBox(tree, facts);
  const size = longestSide(whole);
  const poses = zeroPoses(tree);
  return links.flatMap(({ name, inertial }): Finding[] => {
    if (inertial === null || inertial.mass <= 0 || Math.max(...inertial.xyz.map(Math.abs)) > REACH_M)
      return [];
    const centre = pointThrough(poses.get(name)!, inertial.xyz);
    const outside = Math.hypot(
      ...centre.map((value, i) => Math.max(whole.min[i]! - value, value - whole.max[i]!, 0)),
    );
    if (outside <= size) return [];
    const text = `link ${quoted(name)}: its centre of mass is ${general(outside, 3)} m outside the robot, which measures ${general(size, 3)} m`;
    return [{ severity: 'warning', code: 'centre-outside', text, line: inertial.line }];
  });
}

function shows({ visuals }: Link): boolean {
  return visuals.some(({ shape }) => shape !== null);
}

/** The manifest's member `inertials`, and those `findings` that say a mass is implausible: then no mass is listed. `found`: in
 *  the URDF. */
export function massesOf(
  tree: Tree,
  found: readonly Finding[],
): { inertials: object[]; findings: Finding[] } {
  const findings = [...found, ...massFindings(tree, null)].filter(distrustsMasses);
  return { inertials: findings.length > 0 ? [] : inertialsOf(tree), findings };
}

function inertialsOf(tree: Tree): object[] {
  return linksOf(tree).flatMap(({ inertial }, link) =>
    inertial === null || inertial.mass <= 0
      ? []
      : [{ link, mass_kg: inertial.mass, xyz: inertial.xyz, inertia: turned(inertial) }],
  );
}

function linksOf({ root, joints, links }: Tree): Link[] {
  return root === null ? [] : [root, ...joints.map(({ child }) => links.get(child)!)];
}

/** The links connected by fixed joints to one that has a mass, which may include theirs. */
function heldLinks({ joints }: Tree, links: readonly Link[]): Set<string> {
  const groups = new Map(links.map(({ name }) => [name, name]));
  for (const { type, parent, child } of joints) if (type === 'fixed') groups.set(child, groups.get(parent)!);
  const heavyOnes = new Set(
    links.flatMap(({ name, inertial }) => ((inertial?.mass ?? 0) > 0 ? [groups.get(name)] : [])),
  );
  return new Set([...groups].flatMap(([name, group]) => (heavyOnes.has(group) ? [name] : [])));
}

function emptiness(link: Link, share: number): Problem | null {
  if (!shows(link)) return null;
  return [share > EMPTY_SHARE ? 'mass-zero' : 'massless', 'it is visible but has a mass of 0 kg'];
}

function extreme({ mass, xyz }: Inertial): Problem | null {
  if (mass < 0) return ['mass-negative', `a mass of ${general(mass)} kg`];
  if (mass > MASS_MAX_KG) return ['mass-heavy', `a mass of ${general(mass)} kg`];
  const far = Math.max(...xyz.map(Math.abs));
  if (far > REACH_M) return ['mass-far', `a centre of mass ${general(far, 3)} m away (millimetres?)`];
  return null;
}

function heavy(mass: number, box: number | null, share: number): Problem | null {
  if (box === null || box < BOX_MIN_M3 || mass <= DENSITY_MAX * box) return null;
  const size = `${general(mass, 3)} kg in a box of ${general(box * 1000, 3)} litres`;
  const text = `${size}: more than ${DENSITY_MAX / 1000} kg a litre`;
  return [share > HEAVY_SHARE ? 'mass-heavy' : 'dense', text];
}

function impossible({ mass, moments }: Inertial, share: number): Problem | null {
  const [low, middle, high] = principalMoments(moments);
  const size = Math.max(high, -low);
  const lack = Math.max(high - low - middle, -2 * low);
  if (lack <= SLACK * size) return null;
  const [a, b, c] = [high, middle, low].map((value) => general(value, 3));
  const text = `impossible principal moments of inertia: ${a}, ${b} and ${c} kg·m²`;
  return lack > GROSS * size && size > mass * SPAN_M ** 2 && share > MOMENTS_SHARE
    ? ['mass-moments', text]
    : ['inertia', `${text}; simulators refuse it`];
}

/** The volume of the box around a link's visuals, m³, along its axes; null if it has none, or if some are missing. */
function boxVolume({ visuals }: Link, facts: Facts): number | null {
  const { min, max } = emptyBox();
  for (const visual of visuals) {
    const box = visual.shape === null ? null : boxOf(visual.shape, facts);
    if (box === null) return null;
    expandByBox(min, max, box, poseOf(visual), 0);
  }
  return visuals.length === 0 ? null : max.reduce((volume, value, i) => volume * (value - min[i]!), 1);
}

/** The eigenvalues of a symmetric matrix, given as xx, xy, xz, yy, yz, zz, ascending (O. K. Smith, "Eigenvalues of a
 *  symmetric 3 × 3 matrix", 1961). */
function principalMoments(moments: readonly number[]): readonly [number, number, number] {
  const size = Math.max(...moments.map(Math.abs));
  if (size === 0) return [0, 0, 0];
  const [xx, xy, xz, yy, yz, zz] = moments.map((value) => value / size) as [
    number,
    number,
    number,
    number,
    number,
    number,
  ];
  const mean = (xx + yy + zz) / 3;
  const spread = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * (xy * xy + xz * xz + yz * yz);
  const p = Math.sqrt(spread / 6);
  if (p < 1e-9) return [mean * size, mean * size, mean * size];
  const [a, b, c] = [(xx - mean) / p, (yy - mean) / p, (zz - mean) / p];
  const [d, e, f] = [xy / p, xz / p, yz / p];
  const half = (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / 2;
  const angle = Math.acos(Math.min(Math.max(half, -1), 1)) / 3;
  const high = mean + 2 * p * Math.cos(angle);
  const low = mean + 2 * p * Math.cos(angle + (2 * Math.PI) / 3);
  const clean = (value: number) => (Math.abs(value) < NOISE ? 0 : value * size);
  return [clean(low), clean(3 * mean - high - low), clean(high)];
}

/** The inertia about the centre of mass in the link's axes. */
function turned({ moments, rpy }: Inertial): number[] {
  const [xx, xy, xz, yy, yz, zz] = moments as [number, number, number, number, number, number];
  const own = [
    [xx, xy, xz],
    [xy, yy, yz],
    [xz, yz, zz],
  ] as const;
  const turn = transform([0, 0, 0], quatOfRpy(rpy)); // column-major
  const at = (i: number, j: number): number => {
    let sum = 0;
    for (const [k, row] of own.entries())
      for (const [m, value] of row.entries()) sum += turn[i + 4 * k]! * value * turn[j + 4 * m]!;
    return sum;
  };
  return [at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2)];
}
