/**
 * Forward kinematics of a tree of joints: readings in, root_from_link of every link out.
 *
 * `root_from_child = root_from_parent · T(xyz) · R(quat) · M(q)`, joint by joint in the manifest's order, which puts
 * a parent before its children. Limits never clamp: a monitor shows what is. Nothing is allocated after construction.
 */

export type JointType = 'revolute' | 'continuous' | 'prismatic' | 'fixed' | 'floating' | 'planar';

export interface Joint {
  readonly name: string;
  readonly type: JointType;
  /** Index of the parent link; the child of joint i is link i + 1. */
  readonly parent: number;
  /** parent_from_joint at rest: metres, and a unit quaternion w, x, y, z. */
  readonly xyz: readonly [number, number, number];
  readonly quat: readonly [number, number, number, number];
  /** A unit vector in the joint's frame. */
  readonly axis: readonly [number, number, number];
  readonly limits: { readonly lower: number; readonly upper: number } | null;
  readonly mimic: { readonly joint: number; readonly multiplier: number; readonly offset: number } | null;
}

const SIZE = 16;
const TURN = 0;
const SLIDE = 1;
const STAY = 2;

export class Kinematics {
  /** root_from_link, 16 numbers a link, column after column; metres. Link 0 is the root: always the identity. */
  readonly rootFromLink: Float64Array;
  readonly #names: readonly string[];
  /** Joints that can move, by their place in the manifest. */
  readonly #movable: Int32Array;
  readonly #kind: Uint8Array;
  readonly #parent: Int32Array;
  readonly #axis: Float64Array;
  /** parent_from_joint at rest, as `rootFromLink`. */
  readonly #rest: Float64Array;
  /** The newest reading of each joint, rad or m; NaN until there is one. */
  readonly #reading: Float64Array;
  readonly #leader: Int32Array;
  readonly #multiplier: Float64Array;
  readonly #offset: Float64Array;

  constructor(joints: readonly Joint[]) {
    const count = joints.length;
    this.rootFromLink = new Float64Array((count + 1) * SIZE);
    this.#kind = new Uint8Array(count);
    this.#parent = Int32Array.from(joints, (joint) => joint.parent);
    this.#axis = new Float64Array(count * 3);
    this.#rest = new Float64Array(count * SIZE);
    this.#reading = new Float64Array(count).fill(Number.NaN);
    this.#leader = Int32Array.from(joints, (joint) => joint.mimic?.joint ?? -1);
    this.#multiplier = Float64Array.from(joints, (joint) => joint.mimic?.multiplier ?? 0);
    this.#offset = Float64Array.from(joints, (joint) => joint.mimic?.offset ?? 0);
    joints.forEach((joint, i) => {
      const { type } = joint;
      this.#kind[i] =
        type === 'prismatic' ? SLIDE : type === 'revolute' || type === 'continuous' ? TURN : STAY;
      this.#axis.set(joint.axis, i * 3);
      this.#rest.set(transform(joint.xyz, joint.quat), i * SIZE);
    });
    this.#names = joints.map((joint) => joint.name);
    this.#movable = Int32Array.from(joints.keys()).filter((i) => this.#kind[i] !== STAY);
    this.rootFromLink.set([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    this.compute();
  }

  /** Names of the joints that can move, in the manifest's order. */
  get jointNames(): string[] {
    return Array.from(this.#movable, (i) => this.#names[i]!);
  }

  /** Takes readings by joint name, rad or m. A joint without one, or with one that is no number, keeps its place.
   *  False when nothing changed. */
  set(readings: ReadonlyMap<string, number>): boolean {
    let changed = false;
    for (let m = 0; m < this.#movable.length; m += 1) {
      const i = this.#movable[m]!;
      const reading = readings.get(this.#names[i]!);
      if (reading === undefined || !Number.isFinite(reading) || reading === this.#reading[i]) continue;
      this.#reading[i] = reading;
      changed = true;
    }
    return changed;
  }

  /** rad or m. A follower's own reading wins over what it would copy; without any reading a joint stands at 0. */
  value(joint: number): number {
    const own = this.#reading[joint]!;
    if (!Number.isNaN(own)) return own;
    const leader = this.#leader[joint]!;
    if (leader < 0) return 0;
    const led = this.#reading[leader]!;
    return this.#multiplier[joint]! * (Number.isNaN(led) ? 0 : led) + this.#offset[joint]!;
  }

  /** Rewrites `rootFromLink` for the newest readings. */
  compute(): void {
    for (let i = 0; i < this.#kind.length; i += 1) {
      const from = this.#parent[i]! * SIZE;
      const to = (i + 1) * SIZE;
      multiply(this.rootFromLink, to, this.rootFromLink, from, this.#rest, i * SIZE);
      const kind = this.#kind[i];
      if (kind === TURN) this.#turn(to, i, this.value(i));
      else if (kind === SLIDE) this.#slide(to, i, this.value(i));
    }
  }

  /** Rodrigues: m ← m · R(axis, angle). */
  #turn(m: number, joint: number, angle: number): void {
    if (angle === 0) return;
    const x = this.#axis[joint * 3]!;
    const y = this.#axis[joint * 3 + 1]!;
    const z = this.#axis[joint * 3 + 2]!;
    const c = Math.cos(angle);
    const s = Math.sin(angle);
    const t = 1 - c;
    const pose = this.rootFromLink;
    for (let row = 0; row < 3; row += 1) {
      const a = pose[m + row]!;
      const b = pose[m + 4 + row]!;
      const d = pose[m + 8 + row]!;
      pose[m + row] = a * (t * x * x + c) + b * (t * x * y + s * z) + d * (t * x * z - s * y);
      pose[m + 4 + row] = a * (t * x * y - s * z) + b * (t * y * y + c) + d * (t * y * z + s * x);
      pose[m + 8 + row] = a * (t * x * z + s * y) + b * (t * y * z - s * x) + d * (t * z * z + c);
    }
  }

  #slide(m: number, joint: number, way: number): void {
    const pose = this.rootFromLink;
    for (let row = 0; row < 3; row += 1) {
      pose[m + 12 + row]! +=
        way *
        (pose[m + row]! * this.#axis[joint * 3]! +
          pose[m + 4 + row]! * this.#axis[joint * 3 + 1]! +
          pose[m + 8 + row]! * this.#axis[joint * 3 + 2]!);
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

/** A 4×4 transform, column after column, of a place (metres), a unit quaternion w, x, y, z and a scale. */
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
