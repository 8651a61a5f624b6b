import { emptyBox, growBox, type LinkBox } from './bounds.ts';
import { BundleError, isRecord } from './bundle.ts';
import type { Joint, JointType } from './kinematics.ts';

/**
 * The manifest of a built model (docs/reference/model-bundle.md, version 2): everything that kinematics and a skeleton need, and
 * the names of the levels of detail, which hold the meshes. It comes from the network, so every part is validated before use.
 */
export interface Manifest {
  readonly robot: string;
  /** Coarsest first, at least one unless there is nothing to draw. */
  readonly levels: readonly LodFile[];
  /** Root first. */
  readonly links: readonly string[];
  readonly joints: readonly Joint[];
  readonly visuals: readonly Visual[];
  /** File name of a picture of the robot beside the manifest; null when there is none. */
  readonly thumbnail: string | null;
  readonly missing: readonly { readonly uri: string; readonly reason: string }[];
  /** What `posecast-edge doctor` found in the URDF, worst first. */
  readonly findings: readonly ModelFinding[];
  /** The raw JSON, for data that few pages need; `balance/masses_and_soles.ts` reads more of it. */
  readonly raw: Raw;
}

export interface LodFile {
  readonly name: string;
  readonly path: string;
  readonly bytes: number;
  readonly sha256: string;
}

export interface Visual {
  readonly link: number;
  /** The mesh's URI or the shape, as in the URDF. */
  readonly source: string;
  /** Bounding box in the link's frame, metres. */
  readonly box: LinkBox | null;
  /** Why a box is shown instead of the mesh; null if the mesh exists. */
  readonly placeholder: string | null;
}

export interface ModelFinding {
  readonly severity: string;
  readonly line: number | null;
  readonly text: string;
}

const FILE = /^[a-z0-9][a-z0-9.-]*$/;
const MAX_LINKS = 1000;
const MAX_VISUALS = 1024;
const MAX_LEVEL_BYTES = 128_000_000;
const TYPES: ReadonlySet<unknown> = new Set<JointType>([
  'revolute',
  'continuous',
  'prismatic',
  'fixed',
  'floating',
  'planar',
]);

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

export type Raw = Readonly<Record<string, unknown>>;

/** Validates and reads a version 2 manifest. Throws a one-line BundleError if the robot can't be built from it. */
export function readManifest(raw: Raw): Manifest {
  const links = list(raw.links, 'links', MAX_LINKS).map((name, i) => text(name, `links[${i}]`));
  if (links.length === 0) throw wrong('no links');
  const joints = list(raw.joints, 'joints', MAX_LINKS - 1).map((entry, i) =>
    readJoint(record(entry, `joints[${i}]`), i),
  );
  if (joints.length !== links.length - 1)
    throw wrong(`${links.length} links need ${links.length - 1} joints`);
  unique(links, 'links');
  unique(
    joints.map(({ name }) => name),
    'joints',
  );
  for (const [i, { mimic }] of joints.entries()) {
    if (mimic !== null && joints[mimic.joint] === undefined)
      throw wrong(`joints[${i}] mimics a joint that does not exist`);
  }
  return {
    robot: typeof raw.robot === 'string' ? raw.robot : '',
    levels: list(raw.levels, 'levels', 8).map((entry, i) => readLevelFile(record(entry, `levels[${i}]`), i)),
    links,
    joints,
    visuals: list(raw.visuals, 'visuals', MAX_VISUALS).map((entry, i) =>
      readVisual(record(entry, `visuals[${i}]`), i, links.length),
    ),
    thumbnail: thumbnailOf(raw),
    missing: optionalList(raw.missing).map(({ uri, reason }) => ({ uri: loose(uri), reason: loose(reason) })),
    findings: optionalList(raw.findings).map(({ severity, line, text: words }) => ({
      severity: loose(severity),
      line: typeof line === 'number' ? line : null,
      text: loose(words),
    })),
    raw,
  };
}

/** For each link (by index) with visuals, the box around all of them, in the link's frame, metres. */
export function boxesOfLinks({ visuals }: Manifest): Map<number, LinkBox> {
  const boxes = new Map<number, LinkBox>();
  for (const { link, box } of visuals) {
    if (box === null) continue;
    const whole = boxes.get(link) ?? emptyBox();
    growBox(whole, [...box.min, ...box.max], IDENTITY);
    boxes.set(link, whole);
  }
  return boxes;
}

function readJoint(raw: Raw, i: number): Joint {
  const where = `joints[${i}]`;
  const { parent, child, type } = raw;
  if (child !== i + 1) throw wrong(`${where}: its child is not link ${i + 1}`);
  if (!isIndex(parent, i + 1)) throw wrong(`${where}: its parent comes after it`);
  if (!TYPES.has(type)) throw wrong(`${where}: unknown type`);
  const axis = numbers(raw.axis ?? [1, 0, 0], 3, `${where}.axis`);
  const quat = numbers(raw.quat ?? [1, 0, 0, 0], 4, `${where}.quat`);
  return {
    name: text(raw.name, `${where}.name`),
    type: type as JointType,
    parent,
    xyz: numbers(raw.xyz ?? [0, 0, 0], 3, `${where}.xyz`) as unknown as Joint['xyz'],
    quat: unit(quat, `${where}.quat`) as unknown as Joint['quat'],
    axis: unit(axis, `${where}.axis`) as unknown as Joint['axis'],
    plane: type === 'planar' ? readPlane(raw.plane, `${where}.plane`) : null,
    limits: readLimits(raw.limits),
    mimic: raw.mimic === undefined ? null : readMimic(record(raw.mimic, `${where}.mimic`), where),
  };
}

/** The file name of a model's picture beside its manifest; null for a model without one, or with an unsafe name. */
export function thumbnailOf({ thumbnail }: Raw): string | null {
  return typeof thumbnail === 'string' && FILE.test(thumbnail) ? thumbnail : null;
}

function readPlane(raw: unknown, where: string): Joint['plane'] {
  const ways = list(raw, where, 2).map((way) => unit(numbers(way, 3, where), where));
  if (ways.length !== 2) throw wrong(`${where}: not two directions`);
  return ways as unknown as Joint['plane'];
}

function readLimits(raw: unknown): Joint['limits'] {
  if (!isRecord(raw)) return null;
  const { lower, upper } = raw;
  return isFiniteNumber(lower) && isFiniteNumber(upper) ? { lower, upper } : null;
}

function readMimic(raw: Raw, where: string): Joint['mimic'] {
  const { joint, multiplier = 1, offset = 0 } = raw;
  if (!isIndex(joint, MAX_LINKS) || !isFiniteNumber(multiplier) || !isFiniteNumber(offset)) {
    throw wrong(`${where}.mimic: not an index and two numbers`);
  }
  return { joint, multiplier, offset };
}

function readLevelFile(raw: Raw, i: number): LodFile {
  const { name, path, bytes, sha256 } = raw;
  const where = `levels[${i}]`;
  if (typeof path !== 'string' || !FILE.test(path)) throw wrong(`${where}: bad path`);
  if (!isIndex(bytes, MAX_LEVEL_BYTES)) throw wrong(`${where}: bad size`);
  if (typeof sha256 !== 'string' || !/^[0-9a-f]{64}$/.test(sha256)) throw wrong(`${where}: bad sha256`);
  return { name: loose(name), path, bytes, sha256 };
}

function readVisual(raw: Raw, i: number, links: number): Visual {
  const { link, source, box, placeholder } = raw;
  if (!isIndex(link, links)) throw wrong(`visuals[${i}]: its link does not exist`);
  return {
    link,
    source: loose(source),
    box: box === undefined ? null : readBox(box, `visuals[${i}].box`),
    placeholder: placeholder === undefined ? null : loose(placeholder),
  };
}

function readBox(raw: unknown, where: string): LinkBox {
  const [min, max] = list(raw, where, 2);
  return { min: numbers(min, 3, where) as LinkBox['min'], max: numbers(max, 3, where) as LinkBox['max'] };
}

function wrong(what: string): BundleError {
  return new BundleError(`model manifest: ${what}`);
}

function record(value: unknown, where: string): Raw {
  if (!isRecord(value)) throw wrong(`${where} is not an object`);
  return value;
}

export function list(value: unknown, where: string, most: number): readonly unknown[] {
  if (!Array.isArray(value)) throw wrong(`${where} is not a list`);
  if (value.length > most) throw wrong(`${where}: too many entries, ${value.length}`);
  return value;
}

function optionalList(value: unknown): Raw[] {
  return Array.isArray(value) ? value.slice(0, MAX_VISUALS).filter(isRecord) : [];
}

function text(value: unknown, where: string): string {
  if (typeof value !== 'string') throw wrong(`${where} is not a name`);
  return value;
}

/** Throws if a name occurs twice: links and joints are looked up by name. */
function unique(names: readonly string[], where: string): void {
  if (new Set(names).size < names.length) throw wrong(`${where}: a name is used twice`);
}

/** Lenient text, for values that are only displayed: anything else becomes ''. */
function loose(value: unknown): string {
  return typeof value === 'string' ? value : '';
}

export function numbers(value: unknown, size: number, where: string): number[] {
  if (!Array.isArray(value) || value.length !== size || !value.every(isFiniteNumber)) {
    throw wrong(`${where}: not ${size} numbers`);
  }
  return value;
}

function unit(value: number[], where: string): number[] {
  const length = Math.hypot(...value);
  if (!(Math.abs(length - 1) < 1e-3)) throw wrong(`${where}: not of length 1`);
  return value.map((part) => part / length);
}

export function isIndex(value: unknown, end: number): value is number {
  return Number.isSafeInteger(value) && (value as number) >= 0 && (value as number) < end;
}

function isFiniteNumber(value: unknown): value is number {
  return typeof value === 'number' && Number.isFinite(value);
}
