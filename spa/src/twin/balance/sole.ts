import type { Vec3 } from '../rotation.ts';
import { ConvexHull } from './convex_hull.ts';

/** Two directions are one when the sine between them is less. */
const PARALLEL = 1e-6;

/** The sole of a foot, as the arithmetic needs it. All in the frame of the link that has the sole, metres. */
export interface SolePlane {
  /** A convex polygon, counter-clockwise about `normal`. */
  readonly corners: readonly Vec3[];
  /** A unit vector. What follows does not depend on its sign. */
  readonly normal: Vec3;
  /** The mean of the corners, in the plane. */
  readonly centre: Vec3;
}

/**
 * The plane of a sole, from points in any order. Those of a profile need not lie in one plane exactly, nor be a convex
 * polygon: the plane is that of the largest triangle with their mean and the point farthest from it. null when the
 * points span no area.
 */
export function planeOfSole(points: readonly Vec3[]): SolePlane | null {
  if (points.length < 3 || !points.every((point) => point.every(Number.isFinite))) return null;
  const centre = meanOf(points);
  const arms = points.map((point) => minus(point, centre));
  const far = longest(arms);
  const across = unit(far);
  const widest = longest(arms.map((arm) => cross(far, arm)));
  const reach = Math.hypot(...far);
  if (across === null || Math.hypot(...widest) <= PARALLEL * reach * reach) return null;
  const turning = arms.reduce<Vec3>(
    (sum, arm, i) => plus(sum, cross(arm, arms[(i + 1) % arms.length]!)),
    [0, 0, 0],
  );
  const raw = unit(widest)!;
  const normal: Vec3 = dot(raw, turning) < 0 ? [-raw[0], -raw[1], -raw[2]] : raw;
  const along = cross(normal, across);
  const flat = Float64Array.from(arms.flatMap((arm) => [dot(arm, across), dot(arm, along)]));
  const hull = new ConvexHull(points.length);
  hull.update(flat, points.length);
  const corners = [...hull.corners.subarray(0, hull.count)].map((i) => points[i]!);
  return { corners, normal, centre: meanOf(corners) };
}

function meanOf(points: readonly Vec3[]): Vec3 {
  const [x, y, z] = points.reduce<Vec3>(plus, [0, 0, 0]);
  return [x / points.length, y / points.length, z / points.length];
}

function longest(vectors: readonly Vec3[]): Vec3 {
  return vectors.reduce((most, one) => (dot(one, one) > dot(most, most) ? one : most));
}

function plus(a: Vec3, b: Vec3): Vec3 {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

function minus(a: Vec3, b: Vec3): Vec3 {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

function dot(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

function cross(a: Vec3, b: Vec3): Vec3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function unit(a: Vec3): Vec3 | null {
  const length = Math.hypot(...a);
  return length > 0 ? [a[0] / length, a[1] / length, a[2] / length] : null;
}
