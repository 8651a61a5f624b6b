import type { Vec3 } from '../../twin/rotation.ts';
import { BundleError, isRecord } from '../bundle.ts';
import { isIndex, list, type Manifest, numbers, type Raw } from '../manifest.ts';

export interface LinkMass {
  readonly link: number;
  /** Greater than 0. */
  readonly massKg: number;
  /** Centre of mass in the link's frame, metres. */
  readonly xyz: Vec3;
  /** About that centre, in the link's axes: ixx, ixy, ixz, iyy, iyz, izz; kg·m². */
  readonly inertia: readonly number[];
}

/** The lowest part of a foot's meshes. */
export interface Sole {
  readonly link: number;
  /** A convex polygon in one plane, counter-clockwise seen from above; in the link's frame, metres. */
  readonly points: readonly Vec3[];
}

const MAX_CORNERS = 16;
/** Limits of a plausible link: its mass, and `REACH_M` for the distance of its centre. */
const MAX_KG = 1e6;
/** Lower limit for a plausible robot mass. */
const MIN_KG = 1e-3;
const REACH_M = 100;

/** The links with a mass, in ascending order; [] if the description has no masses or implausible ones; null: an older builder
 *  made the bundle. Throws a one-line BundleError. */
export function readMasses(manifest: Manifest): readonly LinkMass[] | null {
  const masses = readByLink(manifest, 'inertials', readMass);
  if (masses === null || masses.length === 0) return masses;
  const massKg = masses.reduce((sum, mass) => sum + mass.massKg, 0);
  return massKg >= MIN_KG && masses.every(canBe) ? masses : [];
}

/** The links that can be a foot, in ascending order; null: an older builder made the bundle. Throws a one-line BundleError. */
export function readSoles(manifest: Manifest): readonly Sole[] | null {
  return readByLink(manifest, 'soles', readSole);
}

/** Entries that each belong to a different link; null if the member is absent. */
function readByLink<T>(
  { raw, links }: Manifest,
  member: string,
  read: (entry: Raw, link: number, where: string) => T,
): T[] | null {
  if (raw[member] === undefined) return null;
  let before = -1;
  return list(raw[member], member, links.length).map((entry, i) => {
    const where = `${member}[${i}]`;
    if (!isRecord(entry)) throw wrong(`${where} is not an object`);
    const { link } = entry;
    if (!isIndex(link, links.length)) throw wrong(`${where}: its link does not exist`);
    if (link <= before) throw wrong(`${where}: its link does not come after the one before`);
    before = link;
    return read(entry, link, where);
  });
}

function readMass({ mass_kg, xyz, inertia }: Raw, link: number, where: string): LinkMass {
  const [massKg = 0] = numbers([mass_kg], 1, `${where}.mass_kg`);
  if (massKg <= 0) throw wrong(`${where}.mass_kg is not above 0`);
  return {
    link,
    massKg,
    xyz: numbers(xyz, 3, `${where}.xyz`) as unknown as Vec3,
    inertia: numbers(inertia, 6, `${where}.inertia`),
  };
}

function canBe({ massKg, xyz }: LinkMass): boolean {
  return massKg <= MAX_KG && xyz.every((x) => Math.abs(x) <= REACH_M);
}

function readSole({ points }: Raw, link: number, where: string): Sole {
  const corners = list(points, `${where}.points`, MAX_CORNERS);
  if (corners.length < 3) throw wrong(`${where}.points: fewer than 3`);
  return {
    link,
    points: corners.map((corner, i) => numbers(corner, 3, `${where}.points[${i}]`) as unknown as Vec3),
  };
}

function wrong(what: string): BundleError {
  return new BundleError(`model manifest: ${what}`);
}
