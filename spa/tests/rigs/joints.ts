import type { JointValues } from '../../src/twin/playback/pose.ts';

/** Positions of URDF joints (rad or m) by name. */
export function jointsAt(values: Readonly<Record<string, number>>): JointValues {
  return { names: Object.keys(values), values: Object.values(values) };
}

/** A joint's position, rad or m; NaN without a reading, undefined for an unknown joint. */
export function positionOf({ names, values }: JointValues, joint: string): number | undefined {
  return values[names.indexOf(joint)];
}
