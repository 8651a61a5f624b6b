/**
 * Forward kinematics of a tree of joints: joint readings go in, root_from_link of every link comes out
 * (docs/reference/model-bundle.md).
 *
 * `root_from_child = root_from_parent · T(xyz) · R(quat) · M`, joint by joint in the manifest's order, which puts a parent before
 * its children. M is the joint's motion. Joint limits never clamp a value, because a monitor shows what is measured. Nothing is
 * allocated after construction and the first pose of a source.
 */

import { placeOf } from '../twin/names.ts';
import type { JointValues } from '../twin/playback/pose.ts';

export type JointType = 'revolute' | 'continuous' | 'prismatic' | 'fixed' | 'floating' | 'planar';

export type Triple = readonly [number, number, number];

export interface Joint {
  readonly name: string;
  readonly type: JointType;
  /** Index of the parent link; the child of joint i is link i + 1. */
  readonly parent: number;
  /** parent_from_joint at rest: metres, and a unit quaternion w, x, y, z. */
  readonly xyz: Triple;
  readonly quat: readonly [number, number, number, number];
  /** Axis of rotation or sliding, a unit vector in the joint's frame. */
  readonly axis: Triple;
  /** Unit vectors x and y of a planar joint, in the joint's frame; null for any other. */
  readonly plane: readonly [Triple, Triple] | null;
  readonly limits: { readonly lower: number; readonly upper: number } | null;
  readonly mimic: { readonly joint: number; readonly multiplier: number; readonly offset: number } | null;
}

/** The variables of joints with several values, whose readings are named `JOINT/variable`, with their values at rest (rad or m; `rot_*`:
 *  parts of a quaternion). */
export const VARIABLES: Readonly<Record<'planar' | 'floating', readonly (readonly [string, number])[]>> = {
  planar: [
    ['x', 0],
    ['y', 0],
    ['theta', 0],
  ],
  floating: [
    ['trans_x', 0],
    ['trans_y', 0],
    ['trans_z', 0],
    ['rot_x', 0],
    ['rot_y', 0],
    ['rot_z', 0],
    ['rot_w', 1],
  ],
};

const SIZE = 16;
const STAY = 0;
const TURN = 1;
const SLIDE = 2;
const PLANE = 3;
const FLOAT = 4;
const KIND: Readonly<Record<JointType, number>> = {
  fixed: STAY,
  revolute: TURN,
  continuous: TURN,
  prismatic: SLIDE,
  planar: PLANE,
  floating: FLOAT,
};
/** A shorter quaternion counts as no rotation. */
const NO_ROTATION = 1e-6;

/** The joints with a single variable, excluding mimic joints, that move one of these feet or at least 1 % of the mass. */
export function jointsThatCarry(
  joints: readonly Joint[],
  masses: readonly { readonly link: number; readonly massKg: number }[],
  feet: readonly { readonly link: number }[],
): string[] {
  const whole = masses.reduce((sum, { massKg }) => sum + massKg, 0) || 1;
  const beyond = new Float64Array(joints.length + 1);
  for (const { link, massKg } of masses) beyond[link]! += massKg;
  for (const { link } of feet) beyond[link]! += whole;
  for (let i = joints.length; i > 0; i -= 1) beyond[joints[i - 1]!.parent]! += beyond[i]!;
  return joints.flatMap(({ name, type, mimic }, i) => {
    const isOne = KIND[type] === TURN || KIND[type] === SLIDE;
    return isOne && mimic === null && beyond[i + 1]! >= whole / 100 ? [name] : [];
  });
}

/** Computes the pose of every link from joint readings. */
export class Kinematics {
  /** root_from_link: 16 numbers a link, column-major, metres. Link 0 is the root: always the identity. */
  readonly rootFromLink: Float64Array;
  readonly #kind: Uint8Array;
  readonly #parent: Int32Array;
  readonly #axis: Float64Array;
  /** x and y directions of each planar joint's plane, 6 numbers a joint. */
  readonly #plane: Float64Array;
  /** parent_from_joint at rest, as `rootFromLink`. */
  readonly #rest: Float64Array;
  /** Names of all readings; those of one joint are adjacent. */
  readonly #names: string[] = [];
  readonly #slots = new WeakMap<readonly string[], Int32Array>();
  /** For each joint, the index of its first reading. */
  readonly #first: Int32Array;
  /** Newest readings: rad, m, or parts of a quaternion; NaN before the first. */
  readonly #reading: Float64Array;
  /** The value used for a reading that never arrived. */
  readonly #standIn: Float64Array;
  readonly #leader: Int32Array;
  readonly #multiplier: Float64Array;
  readonly #offset: Float64Array;

  constructor(joints: readonly Joint[]) {
    const count = joints.length;
    this.rootFromLink = new Float64Array((count + 1) * SIZE);
    this.#kind = Uint8Array.from(joints, ({ type }) => KIND[type]);
    this.#parent = Int32Array.from(joints, (joint) => joint.parent);
    this.#axis = Float64Array.from(joints.flatMap((joint) => joint.axis));
    this.#plane = Float64Array.from(joints.flatMap(({ plane }) => plane?.flat() ?? [0, 0, 0, 0, 0, 0]));
    this.#rest = Float64Array.from(joints.flatMap(({ xyz, quat }) => transform(xyz, quat)));
    this.#first = new Int32Array(count);
    const standIns: number[] = [];
    joints.forEach(({ name, type }, i) => {
      this.#first[i] = this.#names.length;
      if (type === 'planar' || type === 'floating') {
        for (const [variable, rest] of VARIABLES[type]) {
          this.#names.push(`${name}/${variable}`);
          standIns.push(rest);
        }
      } else if (type !== 'fixed') {
        this.#names.push(name);
        standIns.push(0);
      }
    });
    this.#standIn = Float64Array.from(standIns);
    this.#reading = new Float64Array(standIns.length).fill(Number.NaN);
    this.#leader = Int32Array.from(joints, (joint) => joint.mimic?.joint ?? -1);
    this.#multiplier = Float64Array.from(joints, (joint) => joint.mimic?.multiplier ?? 0);
    this.#offset = Float64Array.from(joints, (joint) => joint.mimic?.offset ?? 0);
    this.rootFromLink.set([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    this.compute();
  }

  /** Names of readings in the manifest's order: a joint's name, or `JOINT/variable` if it has several values. */
  get jointNames(): string[] {
    return [...this.#names];
  }

  /** Takes readings; those in `instead` win. A joint without a finite reading keeps its last one. Returns false if nothing
   *  changed. */
  set(readings: JointValues, instead: JointValues | null = null): boolean {
    const slots = this.#slotsOf(readings);
    const others = instead === null ? null : this.#slotsOf(instead);
    let changed = false;
    for (let i = 0; i < this.#names.length; i += 1) {
      const other = others === null ? Number.NaN : (instead!.values[others[i]!] ?? Number.NaN);
      const reading = Number.isNaN(other) ? readings.values[slots[i]!] : other;
      if (reading === undefined || !Number.isFinite(reading) || reading === this.#reading[i]) continue;
      this.#reading[i] = reading;
      changed = true;
    }
    return changed;
  }

  /** Where each of its readings is among these; -1 for one that is not. Looked up once for each array of names. */
  #slotsOf({ names }: JointValues): Int32Array {
    let slots = this.#slots.get(names);
    if (slots === undefined) {
      slots = Int32Array.from(this.#names, (name) => placeOf(names, name));
      this.#slots.set(names, slots);
    }
    return slots;
  }

  /** The value (rad or m) of a joint that has one. A mimic joint's own reading wins over the one it copies; without any
   *  reading a joint is at 0. */
  value(joint: number): number {
    const own = this.#reading[this.#first[joint]!]!;
    if (!Number.isNaN(own)) return own;
    const leader = this.#leader[joint]!;
    if (leader < 0) return 0;
    const led = this.#reading[this.#first[leader]!]!;
    return this.#multiplier[joint]! * (Number.isNaN(led) ? 0 : led) + this.#offset[joint]!;
  }

  /** Rewrites `rootFromLink` for the newest readings. */
  compute(): void {
    for (let i = 0; i < this.#kind.length; i += 1) {
      const from = this.#parent[i]! * SIZE;
      const to = (i + 1) * SIZE;
      multiply(this.rootFromLink, to, this.rootFromLink, from, this.#rest, i * SIZE);
      switch (this.#kind[i]) {
        case TURN:
          this.#turn(to, i, this.value(i));
          break;
        case SLIDE:
          this.#slide(to, this.#axis, i * 3, this.value(i));
          break;
        case PLANE: {
          const first = this.#first[i]!;
          this.#slide(to, this.#plane, i * 6, this.#variable(first));
          this.#slide(to, this.#plane, i * 6 + 3, this.#variable(first + 1));
          this.#turn(to, i, this.#variable(first + 2));
          break;
        }
        case FLOAT:
          this.#float(to, this.#first[i]!);
          break;
      }
    }
  }

  #variable(i: number): number {
    const reading = this.#reading[i]!;
    return Number.isNaN(reading) ? this.#standIn[i]! : reading;
  }

  /** m ← m · R(axis, angle). */
  #turn(m: number, joint: number, angle: number): void {
    if (angle === 0) return;
    const at = joint * 3;
    const half = Math.sin(angle / 2);
    this.#rotate(
      m,
      Math.cos(angle / 2),
      half * this.#axis[at]!,
      half * this.#axis[at + 1]!,
      half * this.#axis[at + 2]!,
    );
  }

  /** m ← m · T(way · direction); the direction is the three numbers from `at` on in `directions`. */
  #slide(m: number, directions: Float64Array, at: number, way: number): void {
    this.#shift(m, way * directions[at]!, way * directions[at + 1]!, way * directions[at + 2]!);
  }

  /** m ← m · T(translation) · R(quaternion), seven variables from `first` on. */
  #float(m: number, first: number): void {
    this.#shift(m, this.#variable(first), this.#variable(first + 1), this.#variable(first + 2));
    const x = this.#variable(first + 3);
    const y = this.#variable(first + 4);
    const z = this.#variable(first + 5);
    const w = this.#variable(first + 6);
    const length = Math.hypot(x, y, z, w);
    if (length >= NO_ROTATION) this.#rotate(m, w / length, x / length, y / length, z / length);
  }

  #shift(m: number, x: number, y: number, z: number): void {
    const pose = this.rootFromLink;
    for (let row = m; row < m + 3; row += 1) {
      pose[row + 12]! += x * pose[row]! + y * pose[row + 4]! + z * pose[row + 8]!;
    }
  }

  /** m ← m · R of a unit quaternion. */
  #rotate(m: number, w: number, x: number, y: number, z: number): void {
    const pose = this.rootFromLink;
    for (let row = m; row < m + 3; row += 1) {
      const a = pose[row]!;
      const b = pose[row + 4]!;
      const c = pose[row + 8]!;
      pose[row] = a * (1 - 2 * (y * y + z * z)) + b * 2 * (x * y + w * z) + c * 2 * (x * z - w * y);
      pose[row + 4] = a * 2 * (x * y - w * z) + b * (1 - 2 * (x * x + z * z)) + c * 2 * (y * z + w * x);
      pose[row + 8] = a * 2 * (x * z + w * y) + b * 2 * (y * z - w * x) + c * (1 - 2 * (x * x + y * y));
    }
  }
}

/** out ← a · b for transforms inside longer arrays, each at its own offset; `out` may not overlap either. */
export function multiply(
  out: Float64Array | Float32Array,
  o: number,
  a: ArrayLike<number>,
  at: number,
  b: ArrayLike<number>,
  bt: number,
): void {
  for (let column = 0; column < SIZE; column += 4) {
    const x = b[bt + column]!;
    const y = b[bt + column + 1]!;
    const z = b[bt + column + 2]!;
    const w = b[bt + column + 3]!;
    for (let row = 0; row < 4; row += 1) {
      out[o + column + row] =
        a[at + row]! * x + a[at + 4 + row]! * y + a[at + 8 + row]! * z + a[at + 12 + row]! * w;
    }
  }
}

/** worldFromLink ← worldFromRoot · rootFromLink, for every link: 16 numbers each. */
export function placeLinks(
  worldFromRoot: ArrayLike<number>,
  rootFromLink: Float64Array,
  worldFromLink: Float64Array,
): void {
  for (let at = 0; at < rootFromLink.length; at += SIZE) {
    multiply(worldFromLink, at, worldFromRoot, 0, rootFromLink, at);
  }
}

/** A column-major 4×4 transform from a translation (metres), a unit quaternion w, x, y, z and a uniform scale. */
export function transform(
  [tx, ty, tz]: readonly [number, number, number],
  [w, x, y, z]: readonly [number, number, number, number],
  scale = 1,
): number[] {
  const s = scale;
  return [
    ...[s * (1 - 2 * (y * y + z * z)), s * 2 * (x * y + w * z), s * 2 * (x * z - w * y), 0],
    ...[s * 2 * (x * y - w * z), s * (1 - 2 * (x * x + z * z)), s * 2 * (y * z + w * x), 0],
    ...[s * 2 * (x * z + w * y), s * 2 * (y * z - w * x), s * (1 - 2 * (x * x + y * y)), 0],
    ...[tx, ty, tz, 1],
  ];
}
