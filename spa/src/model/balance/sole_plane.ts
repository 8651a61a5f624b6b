import type { Vec2 } from '../../twin/balance/balance.ts';
import { convexHull } from '../../twin/balance/convex_hull.ts';
import type { SolePlane } from '../../twin/balance/standing.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { addScaled, cross, dot, normalize, scale } from '../vectors.ts';

/** Two directions with a smaller sine between them count as equal. */
const PARALLEL = 1e-6;
/** A corner of a foot can't be farther than this (metres) from the frame's origin along an axis. */
const REACH_M = 10;
/** The corners of a sole can't be farther than this (metres) from its plane. */
const FLAT_M = 0.01;

/**
 * The plane of a sole, from points in any order. They may be a centimetre off their plane, and need not be a convex polygon: the
 * plane is that of the largest triangle with their mean and the point farthest from it. `body` is a point on the inside of that
 * plane, in the same frame. null if the points span no area or can't be a sole: beyond 10 m, or not flat.
 */
export function planeOfSole(points: readonly Vec3[], body: Vec3): SolePlane | null {
  if (points.length < 3 || !points.flat().every((x) => Math.abs(x) <= REACH_M)) return null;
  const centre = meanOf(points);
  const arms = points.map((point) => addScaled(point, centre, -1));
  const far = longest(arms);
  const widest = longest(arms.map((arm) => cross(far, arm)));
  if (Math.hypot(...widest) <= PARALLEL * dot(far, far)) return null;
  const normal = scale(normalize(widest), dot(widest, addScaled(body, centre, -1)) < 0 ? -1 : 1);
  if (arms.some((arm) => Math.abs(dot(arm, normal)) > FLAT_M)) return null;
  const across = normalize(far);
  const along = cross(normal, across);
  const flat = arms.map((arm): Vec2 => [dot(arm, across), dot(arm, along)]);
  const corners = convexHull(flat).map((i) => points[i]!);
  return { corners, normal, centre: meanOf(corners) };
}

function meanOf(points: readonly Vec3[]): Vec3 {
  return scale(points.reduce(sumOf), 1 / points.length);
}

function longest(vectors: readonly Vec3[]): Vec3 {
  return vectors.reduce((most, one) => (dot(one, one) > dot(most, most) ? one : most));
}

function sumOf(a: Vec3, b: Vec3): Vec3 {
  return addScaled(a, b);
}
