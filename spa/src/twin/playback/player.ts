import type { Schema } from '@posecast/wire';
import type { FootWrench } from '../balance/balance.ts';
import { ValueLimits } from '../limits.ts';
import { placeOf } from '../names.ts';
import type { RobotState } from '../robot.ts';
import type { Quat, Vec3 } from '../rotation.ts';
import { type Imu, ImuTable } from '../sensors/imus.ts';
import { WrenchTable } from '../sensors/wrenches.ts';
import { Playout } from './playout.ts';
import { type Base, baseOf, isUnturned, type JointValues, type Pose, Poser } from './pose.ts';

/** Numbers of one sensor: force and moment. */
const SIZE = 6;

/** The values of force-torque sensors as numbers that can be played with the pose. */
export class ForcePlay {
  readonly #table: WrenchTable;
  readonly #limits: ValueLimits;
  /** For each sensor, whether its force and its moment had a reading in the newest frame: without one, playback stops. */
  readonly #isRead: [force: boolean, moment: boolean][];

  constructor(schema: Schema) {
    this.#table = new WrenchTable(schema);
    this.#limits = new ValueLimits(schema.mapping);
    this.#isRead = this.#table.wrenches.map(() => [false, false]);
  }

  /** How many numbers there are. */
  get size(): number {
    return this.#table.wrenches.length * SIZE;
  }

  /** Writes a frame's numbers; NaN without a reading. */
  read(codes: Int32Array, into: Float64Array): void {
    this.#table.read(codes, this.#limits).forEach(({ force, moment }, i) => {
      into.set(force.vector ?? NONE, i * SIZE);
      into.set(moment.vector ?? NONE, i * SIZE + 3);
      this.#isRead[i] = [force.vector !== null, moment.vector !== null];
    });
  }

  /** The wrenches for played numbers, in their channels' units. */
  of(numbers: Float64Array): FootWrench[] {
    const at = (i: number): Vec3 => [numbers[i]!, numbers[i + 1]!, numbers[i + 2]!];
    return this.#table.wrenches.map(({ site, force, moment }, i) => {
      const [hasForce, hasMoment] = this.#isRead[i]!;
      return {
        site,
        force: { vector: hasForce ? at(i * SIZE) : null, axes: force.axes },
        moment: { vector: hasMoment ? at(i * SIZE + 3) : null, axes: moment.axes },
      };
    });
  }
}

const NONE = [Number.NaN, Number.NaN, Number.NaN];

/**
 * The displayed motion of one robot, with a small delay and interpolated: joint positions and commands, base, sensor orientations
 * and forces, all for the same moment. Warnings (flags, colours of forces, liveness) are not delayed: they are read from the
 * newest frame.
 *
 * A new schema needs a new player.
 */
export class Player {
  readonly #schema: Schema;
  readonly #pos: Poser;
  readonly #ref: Poser | null;
  readonly #imus: ImuTable;
  readonly #playout: Playout;
  readonly #values: Float64Array;
  readonly #wraps = new Set<number>();
  readonly #refAt: number;
  readonly #baseAt: number;
  readonly #imusAt: number;
  readonly #forces: ForcePlay;
  readonly #forcesAt: number;
  #unread: ReadonlySet<string> = new Set();
  #unturned = false;

  constructor(schema: Schema) {
    this.#schema = schema;
    this.#pos = new Poser(schema, 'pos');
    this.#ref = schema.field('ref') === null ? null : new Poser(schema, 'ref');
    this.#imus = new ImuTable(schema);
    this.#refAt = this.#pos.joints.length;
    this.#baseAt = this.#refAt + (this.#ref?.joints.length ?? 0);
    this.#imusAt = this.#baseAt + 7;
    this.#forcesAt = this.#imusAt + 4 * this.#imus.imus.length;
    this.#forces = new ForcePlay(schema);
    const size = this.#forcesAt + this.#forces.size;
    this.#values = new Float64Array(size);
    this.#playout = new Playout({
      size,
      wraps: this.#wraps,
      quats: [this.#baseAt + 3, ...this.#imus.imus.map((_, i) => this.#imusAt + 4 * i)],
    });
  }

  /** If true, shows each frame on arrival, without delay or interpolation. */
  set raw(raw: boolean) {
    this.#playout.raw = raw;
  }

  /** The current delay, ms, behind the earliest moment at which frames can arrive. */
  get delayMs(): number {
    return this.#playout.delayMs;
  }

  /** Sets which URDF joints are continuous (wrap at ±π), which only the model knows. */
  setContinuous(joints: readonly string[]): void {
    this.#wraps.clear();
    for (const joint of joints) {
      const pos = placeOf(this.#pos.joints, joint);
      const ref = this.#ref === null ? -1 : placeOf(this.#ref.joints, joint);
      if (pos >= 0) this.#wraps.add(pos);
      if (ref >= 0) this.#wraps.add(this.#refAt + ref);
    }
  }

  /** Takes a state of this schema. True when a new picture may be needed. */
  push({ seq, tS, atMs, codes }: RobotState): boolean {
    const values = this.#values;
    const pos = this.#pos.values(codes);
    values.set(pos);
    if (this.#ref !== null) values.set(this.#ref.values(codes), this.#refAt);
    const base = baseOf(this.#schema, codes);
    values.set([...(base?.xyz ?? NOWHERE), ...(base?.quat_wxyz ?? UNTURNED)], this.#baseAt);
    this.#imus.read(codes).forEach((imu, i) => {
      values.set(imu.worldFromSensor ?? UNTURNED, this.#imusAt + 4 * i);
    });
    this.#forces.read(codes, values.subarray(this.#forcesAt));
    const unread = this.#pos.joints.filter((_, i) => Number.isNaN(pos[i]));
    const unturned = isUnturned(this.#schema, base, this.#imus.body);
    const other =
      unturned !== this.#unturned ||
      unread.length !== this.#unread.size ||
      unread.some((joint) => !this.#unread.has(joint));
    if (other) this.#unread = new Set(unread);
    this.#unturned = unturned;
    return this.#playout.push({ seq, tS, atMs }, values) || other;
  }

  /** Advances to `nowMs` of the viewer's clock. True while more motion is waiting to be played. */
  sample(nowMs: number): boolean {
    return this.#playout.sample(nowMs);
  }

  /** The pose at the newest `sample`. A robot without `ref` is shown by `pos`. */
  pose(shown: 'pos' | 'ref' | 'both'): Pose {
    const joints = this.#joints(shown === 'ref' ? (this.#ref ?? this.#pos) : this.#pos);
    const ghost = shown === 'both' && this.#ref !== null ? this.#joints(this.#ref) : null;
    const { shownS: tS, shown: values } = this.#playout;
    const wrenches = this.#forces.of(values.subarray(this.#forcesAt));
    const [unread, unturned] = [this.#unread, this.#unturned];
    return { joints, base: this.#base(), unread, unturned, lean: this.#lean(), ghost, tS, wrenches };
  }

  #joints({ joints: names }: Poser): JointValues {
    const from = names === this.#ref?.joints ? this.#refAt : 0;
    return { names, values: this.#playout.shown.subarray(from, from + names.length) };
  }

  /** The played orientation of a sensor; null if the robot has none with this name, or no reading yet. */
  worldFromSensor(imu: Imu): Quat | null {
    const i = this.#imus.imus.findIndex(({ site }) => site === imu.site);
    return i < 0 ? null : this.#quat(this.#imusAt + 4 * i);
  }

  #lean(): Imu | null {
    const { body } = this.#imus;
    return body === null ? null : { ...body, worldFromSensor: this.worldFromSensor(body) };
  }

  #base(): Base | null {
    const at = this.#baseAt;
    const [x, y, z] = this.#playout.shown.subarray(at, at + 3);
    const quat_wxyz = this.#quat(at + 3);
    return quat_wxyz === null ? null : { xyz: [x!, y!, z!], quat_wxyz };
  }

  #quat(at: number): Quat | null {
    const [w, x, y, z] = this.#playout.shown.subarray(at, at + 4);
    return Number.isNaN(w) ? null : [w!, x!, y!, z!];
  }
}

const NOWHERE = [Number.NaN, Number.NaN, Number.NaN];
const UNTURNED = [Number.NaN, Number.NaN, Number.NaN, Number.NaN];
