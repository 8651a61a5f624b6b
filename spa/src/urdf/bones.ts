import { transform } from '../model/kinematics.ts';
import { quatOfRpy } from '../model/vectors.ts';
import type { Tree } from './tree.ts';
import { type Joint, SCALAR_TYPES, type Vector } from './types.ts';

/** A cylinder (radius, length) or box of a skeleton, in its link's frame, metres. `isAxis`: it shows a joint's axis. */
export interface Bone {
  readonly kind: 'cylinder' | 'box';
  readonly dims: readonly number[];
  readonly xyz: Vector;
  readonly quat: readonly [number, number, number, number];
  readonly isAxis: boolean;
}

/** No part of a robot is farther away than this, 10,000 km. */
const FAR = 1e7;
/** A bone shorter than this (metres) is not drawn. */
const LEAST = 1e-6;
/** Half a bone's thickness, the radius of a joint's disc, and the minimum of both: as fractions of the bone's length, and of the
 *  longest path from the root to a tip. The edge has the same (posecast_edge/model/builder/visuals.py). */
const [THICK, THICK_MAX] = [0.09, 0.016];
const [WIDE, WIDE_MAX] = [0.16, 0.024];
const THIN = 0.003;
/** Length of the part that shows the rotation of a last link, as a fraction of the bone before it. */
const STUB = 0.4;

/**
 * The bones from joint to joint and the joints' axes for all links without visuals, by the link's index, if these are most of the
 * robot; otherwise none. `dressed`: the links (indices) with visuals. Links held together by fixed joints count as one.
 */
export function bonesOf({ root, joints }: Tree, dressed: ReadonlySet<number>): Map<number, Bone[]> {
  if (root === null) return new Map();
  const linkOf = new Map([root.name, ...joints.map(({ child }) => child)].map((name, i) => [name, i]));
  const parents = joints.map(({ parent }) => linkOf.get(parent)!);
  const rigid = [0]; // the first link of each link's rigid group
  for (const [i, { type }] of joints.entries()) rigid.push(type === 'fixed' ? rigid[parents[i]!]! : i + 1);
  const clothed = new Set([...dressed].map((link) => rigid[link]!));
  const withBone = new Set(
    joints.flatMap(({ xyz }, i) => (lengthOf(xyz) > LEAST ? [rigid[parents[i]!]!] : [])),
  );
  const bare = [...withBone].filter((part) => !clothed.has(part)).length;
  if (2 * bare <= new Set([...withBone, ...clothed]).size) return new Map();
  const maker = new BoneMaker(joints, parents);
  const made = new Map<number, Bone[]>();
  for (const [link, part] of rigid.entries()) {
    const bones = clothed.has(part) ? [] : maker.make(link);
    if (bones.length > 0) made.set(link, bones);
  }
  return made;
}

class BoneMaker {
  readonly #joints: readonly Joint[];
  readonly #below: readonly Joint[][];
  readonly #longest: number;
  /** For each link, the length of the bones around it, metres; at least half of that of the link before it. */
  readonly #scales: number[] = [];
  /** For each link, in its frame, the direction of the last bone before it; null if there is none. */
  readonly #ways: (Vector | null)[] = [null];

  constructor(joints: readonly Joint[], parents: readonly number[]) {
    this.#joints = joints;
    this.#below = [[], ...joints.map((): Joint[] => [])];
    const ways = [0];
    for (const [i, joint] of joints.entries()) {
      this.#below[parents[i]!]!.push(joint);
      ways.push(ways[parents[i]!]! + lengthOf(joint.xyz));
    }
    for (const [i, { xyz, rpy }] of joints.entries()) {
      const way = (lengthOf(xyz) > LEAST ? unit(xyz) : null) ?? this.#ways[parents[i]!]!;
      this.#ways.push(way === null ? null : turnedBack(way, rpy));
    }
    this.#longest = ways.reduce((longest, way) => Math.max(longest, way), 0);
    for (const [link, below] of this.#below.entries()) {
      const own = link === 0 ? 0 : lengthOf(joints[link - 1]!.xyz);
      const near = below.reduce((most, { xyz }) => Math.max(most, lengthOf(xyz)), own);
      const before = link === 0 ? 0 : this.#scales[parents[link - 1]!]!;
      this.#scales.push(Math.max(near, before / 2));
    }
  }

  /** The bones from a link to its joints, and the axis of the joint that moves it. */
  make(link: number): Bone[] {
    const bones = this.#below[link]!.flatMap(({ xyz }) => this.#bone(xyz));
    const joint = this.#joints[link - 1];
    if (joint === undefined || !SCALAR_TYPES.has(joint.type)) return bones;
    const axis = (joint.axis && unit(joint.axis)) ?? DEFAULT_AXIS;
    bones.push(this.#axis(link, joint, axis));
    if (this.#below[link]!.length === 0) {
      const length = STUB * this.#scales[link]!;
      const [x, y, z] = this.#ways[link] ?? across(axis);
      bones.push(...this.#bone([x * length, y * length, z * length]));
    }
    return bones;
  }

  #bone(end: Vector): Bone[] {
    const length = lengthOf(end);
    const way = unit(end);
    if (length <= LEAST || way === null || !(length <= FAR)) return [];
    const radius = Math.max(Math.min(THICK * length, THICK_MAX * this.#longest), THIN * this.#longest);
    const xyz = [end[0] / 2, end[1] / 2, end[2] / 2] as const;
    return [{ kind: 'cylinder', dims: [radius, length], xyz, quat: alongZ(way), isAxis: false }];
  }

  /** A disc across the axis of a revolute joint, a bar along that of a prismatic one. */
  #axis(link: number, { type }: Joint, axis: Vector): Bone {
    const most = Math.min(WIDE * this.#scales[link]!, WIDE_MAX * this.#longest);
    const radius = Math.max(most, 1.5 * THIN * this.#longest);
    const at = { xyz: [0, 0, 0], quat: alongZ(axis), isAxis: true } as const;
    return type === 'prismatic'
      ? { kind: 'box', dims: [1.5 * radius, 1.5 * radius, 5 * radius], ...at }
      : { kind: 'cylinder', dims: [radius, 1.5 * radius], ...at };
  }
}

/** The direction of `way` (in the parent's frame) in the frame of a joint that is turned by `rpy`. */
function turnedBack([x, y, z]: Vector, rpy: Vector): Vector {
  const m = transform([0, 0, 0], quatOfRpy(rpy));
  const row = (i: number) => m[i * 4]! * x + m[i * 4 + 1]! * y + m[i * 4 + 2]! * z;
  return [row(0), row(1), row(2)];
}

/** A rotation that maps z to a unit vector. */
function alongZ([x, y, z]: Vector): Bone['quat'] {
  return quatOfRpy([0, Math.atan2(Math.hypot(x, y), z), Math.atan2(y, x)]);
}

/** A unit vector perpendicular to a unit vector. */
function across([x, y, z]: Vector): Vector {
  return (Math.abs(z) < 0.9 ? unit([y, -x, 0]) : unit([-z, 0, x]))!;
}

/** The axis of a joint that has none, in URDF. */
export const DEFAULT_AXIS: Vector = [1, 0, 0];

/** The direction of a vector; null if it has no length. */
export function unit(vector: Vector): Vector | null {
  const longest = Math.max(...vector.map(Math.abs));
  if (!(longest > 1e-9)) return null;
  const [x, y, z] = vector.map((part) => part / longest) as [number, number, number]; // the square of a large number overflows
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

function lengthOf(vector: Vector): number {
  return Math.hypot(...vector);
}
