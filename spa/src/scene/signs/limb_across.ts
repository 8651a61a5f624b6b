import {
  addScaled,
  directionThrough,
  dot,
  normalize,
  rejectFrom,
  scale,
  type Transform,
} from '../../model/vectors.ts';
import type { Vec3 } from '../../twin/rotation.ts';

/** If the component of a direction across the axis is shorter than this (squared, unit vectors), it counts as zero. */
const ALONG_AXIS = 0.02;
const DOWN: Vec3 = [0, 0, -1];

/** The direction of the limb that a joint turns, as a unit vector across the joint's axis in the world: towards the middle of the
 *  moved link's box (in its frame, if it has one), else down, else ahead. */
export function limbAcross(
  axis: Vec3,
  box: { readonly min: Vec3; readonly max: Vec3 } | undefined,
  worldFromLink: Transform,
): Vec3 {
  const limb = box && directionThrough(worldFromLink, scale(addScaled(box.min, box.max), 0.5));
  const ways: readonly Vec3[] = [limb ?? DOWN, DOWN, [1, 0, 0]];
  const found = ways.map((way) => rejectFrom(way, axis)).find((way) => dot(way, way) >= ALONG_AXIS);
  return normalize(found ?? [0, 1, 0]);
}
