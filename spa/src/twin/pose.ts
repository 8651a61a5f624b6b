import { JointMapping, type Schema } from '@posecast/wire';
import { valueAt } from './values.ts';

/** What the body looks like at one instant: URDF joints (rad, or m for sliding ones) and where the root link is. */
export interface Pose {
  joints: ReadonlyMap<string, number>;
  /** world_from_root, metres and a unit quaternion; null when the robot reports no base: the scene stands it on the floor. */
  base: { xyz: [number, number, number]; quat_wxyz: [number, number, number, number] } | null;
}

/** Turns the codes of one schema into bodies: where the joints are (`pos`) or where they were told to be (`ref`). */
export class Poser {
  readonly #schema: Schema;
  readonly #mapping: JointMapping;

  constructor(schema: Schema, shown: 'pos' | 'ref') {
    this.#schema = schema;
    this.#mapping = new JointMapping(schema, shown);
  }

  /** A joint without a reading is left out, so that it stays where it was last known. */
  pose(codes: Int32Array): Pose {
    const values = this.#mapping.evaluate(codes);
    const joints = new Map<string, number>();
    this.#mapping.joints.forEach((joint, i) => {
      const value = values[i];
      if (value !== undefined && Number.isFinite(value)) joints.set(joint, value);
    });
    return { joints, base: baseOf(this.#schema, codes) };
  }
}

function baseOf(schema: Schema, codes: Int32Array): Pose['base'] {
  const [x, y, z] = valuesOf(schema, codes, 'base', ['base.x', 'base.y', 'base.z']);
  const [qw, qx, qy, qz] = valuesOf(schema, codes, 'baseq', ['base.w', 'base.x', 'base.y', 'base.z']);
  if (x === undefined || y === undefined || z === undefined) return null;
  if (qw === undefined || qx === undefined || qy === undefined || qz === undefined) return null;
  return { xyz: [x, y, z], quat_wxyz: [qw, qx, qy, qz] };
}

/** All of them, or none. */
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
