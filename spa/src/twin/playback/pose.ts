import { JointMapping, type Schema } from '@posecast/wire';
import type { FootWrench } from '../balance/balance.ts';
import { normalizeQuat, type Quat, type Vec3 } from '../rotation.ts';
import type { Imu } from '../sensors/imus.ts';
import { valueAt } from '../values.ts';

/** Positions of URDF joints, rad, or m for prismatic ones. */
export interface JointValues {
  /** The same array for all poses of a source, so that a reader looks its joints up once. */
  readonly names: readonly string[];
  /** In the order of `names`; NaN where there is no reading. A source may overwrite them with its next pose. */
  readonly values: ArrayLike<number>;
}

export const NO_JOINTS: JointValues = { names: [], values: [] };

/** A robot's pose at one instant: its joints and the pose of the root link. */
export interface Pose {
  joints: JointValues;
  /** world_from_root, metres and a unit quaternion; null if the robot reports no base: the scene then stands it on the floor. */
  base: Base | null;
  /** URDF joints without a reading now: they stay at their last known position. */
  unread?: ReadonlySet<string>;
  /** Whether the declared source of the body's orientation has no reading now: the orientation then stays as last known. */
  unturned?: boolean;
  /** The sensor of the body's orientation, with its reading; for a robot without a base. */
  lean?: Imu | null;
  /** The commanded joints of a second, transparent body that is shown whole. */
  ghost?: JointValues | null;
  /** Robot time of this pose, seconds. */
  tS?: number;
  /** The wrenches at the same moment, from the sensors mounted on a link, in their channels' units. */
  wrenches?: readonly FootWrench[];
}

/** world_from_root: metres, and a unit quaternion w, x, y, z. */
export interface Base {
  xyz: Vec3;
  quat_wxyz: Quat;
}

/** Why the link positions of a pose are unknown, given the joints that carry weight; undefined while they are known. */
export function whyUnknown(
  { unturned, unread }: Pick<Pose, 'unturned' | 'unread'>,
  carriers: readonly string[],
): 'orientation-unread' | 'joint-unread' | undefined {
  if (unturned) return 'orientation-unread';
  return carriers.some((joint) => unread?.has(joint)) ? 'joint-unread' : undefined;
}

/** Turns a frame's codes into poses: by measured positions (`pos`) or by commands (`ref`). */
export class Poser {
  readonly #schema: Schema;
  readonly #mapping: JointMapping;

  constructor(schema: Schema, shown: 'pos' | 'ref') {
    this.#schema = schema;
    this.#mapping = new JointMapping(schema, shown);
  }

  /** URDF joints in the order of `values`. */
  get joints(): readonly string[] {
    return this.#mapping.joints;
  }

  /** Joint values, rad or m; NaN without a reading. Always the same array. */
  values(codes: Int32Array): Float64Array {
    return this.#mapping.evaluate(codes);
  }

  /** The pose of a frame, with the sensor of the body's orientation as read from the same frame. */
  pose(codes: Int32Array, lean: Imu | null = null): Pose {
    const names = this.joints;
    const values = this.values(codes);
    const unread = new Set(names.filter((_, i) => !Number.isFinite(values[i])));
    const base = baseOf(this.#schema, codes);
    return { joints: { names, values }, base, unread, lean, unturned: isUnturned(this.#schema, base, lean) };
  }
}

const BASE: readonly (readonly [field: string, labels: readonly string[]])[] = [
  ['base', ['base.x', 'base.y', 'base.z']],
  ['baseq', ['base.w', 'base.x', 'base.y', 'base.z']],
];

/** Whether the source of the body's orientation has no reading: odometry if the robot declares it, else the IMU of its body. A
 *  robot that declares neither is assumed to be upright. */
export function isUnturned(schema: Schema, base: Base | null, imu: Imu | null): boolean {
  const declared = BASE.every(([name, labels]) => {
    const field = schema.field(name);
    return field !== null && labels.every((label) => field.labels.includes(label));
  });
  return declared ? base === null : imu !== null && imu.worldFromSensor === null;
}

/** world_from_root from the robot's odometry; null without odometry or a reading, or if the quaternion has no length. */
export function baseOf(schema: Schema, codes: Int32Array): Base | null {
  const [x, y, z, qw, qx, qy, qz] = BASE.flatMap(([name, labels]) => valuesOf(schema, codes, name, labels));
  if (x === undefined || y === undefined || z === undefined) return null;
  if (qw === undefined || qx === undefined || qy === undefined || qz === undefined) return null;
  const quat = normalizeQuat([qw, qx, qy, qz]);
  return quat === null ? null : { xyz: [x, y, z], quat_wxyz: quat };
}

/** The values of these channels; an empty list if any of them has no reading. */
function valuesOf(schema: Schema, codes: Int32Array, name: string, labels: readonly string[]): number[] {
  const field = schema.field(name);
  if (field === null) return [];
  const values: number[] = [];
  for (const label of labels) {
    const value = valueAt(codes, field, field.labels.indexOf(label));
    if (value === null) return [];
    values.push(value);
  }
  return values;
}
