import type { URDFJoint, URDFRobot } from 'urdf-loader';
import { FreeJoint } from './free_joint.ts';

const SLIDES_OR_TURNS: ReadonlySet<string> = new Set(['revolute', 'continuous', 'prismatic']);

export function slidesOrTurns({ jointType }: URDFJoint): boolean {
  return SLIDES_OR_TURNS.has(jointType);
}

/** The joints of a robot as urdf-loader reads it. One without a reading keeps its place. */
export class UrdfJoints {
  /** Those of one value. */
  readonly joints: readonly URDFJoint[];
  /** The newest reading of each; NaN until there is one. */
  readonly #angles: Float64Array;
  readonly #free: readonly FreeJoint[];

  constructor({ joints }: URDFRobot) {
    // A joint that mimics another comes last: where the robot reports it, its own reading wins.
    this.joints = Object.values(joints)
      .filter(slidesOrTurns)
      .sort((a, b) => Number('mimicJoint' in a) - Number('mimicJoint' in b));
    this.#angles = new Float64Array(this.joints.length).fill(Number.NaN);
    for (const joint of this.joints) {
      joint.ignoreLimits = true; // a monitor shows what is, also where it should not be
      if (!('mimicJoint' in joint)) joint.setJointValue(0); // followers take their offsets
    }
    this.#free = Object.values(joints).flatMap(freeJoint);
  }

  /** What readings are called: a joint's name, or `JOINT/variable` for one of several values. */
  get names(): string[] {
    return [...this.joints.map(({ name }) => name), ...this.#free.flatMap(({ names }) => names)];
  }

  /** Turns them; rad or m by URDF name. False when nothing changed: then there is nothing to draw. */
  set(angles: ReadonlyMap<string, number>): boolean {
    let changed = false;
    for (const [i, joint] of this.joints.entries()) {
      const angle = angles.get(joint.name);
      if (angle === undefined || !Number.isFinite(angle) || angle === this.#angles[i]) continue;
      this.#angles[i] = angle;
      changed = true;
    }
    if (changed) {
      for (const [i, joint] of this.joints.entries()) {
        const angle = this.#angles[i]!;
        if (!Number.isNaN(angle)) joint.setJointValue(angle);
      }
    }
    for (const joint of this.#free) changed = joint.set(angles) || changed;
    return changed;
  }
}

function freeJoint(joint: URDFJoint): FreeJoint[] {
  const { jointType: type, name, axis, urdfNode } = joint;
  if (type !== 'planar' && type !== 'floating') return [];
  // the loader takes z where the standard says x
  const written = urdfNode?.querySelector('axis') != null && axis.lengthSq() > 0;
  return [new FreeJoint(joint, name, type, written ? axis.toArray() : null)];
}
