import type { Vec3 } from '../rotation.ts';
import type { Vec2 } from './balance.ts';

/** The position of a point relative to a polygon. */
export interface Margin {
  /** Distance to the nearest edge, metres; positive inside, negative outside, 0 on it. */
  readonly metres: number;
  /** The index of the corner at which that edge begins; the first of several equally near ones. */
  readonly edge: number;
}

/** How far a point is inside a convex, counter-clockwise polygon of at least one corner. A polygon of one or two corners
 *  has no inside. */
export function marginIn(polygon: readonly Vec2[], point: Vec2): Margin {
  let inside = polygon.length > 2;
  let [least, edge] = [Number.POSITIVE_INFINITY, 0];
  for (const [i, from] of polygon.entries()) {
    const to = polygon[(i + 1) % polygon.length]!;
    const turn = (to[0] - from[0]) * (point[1] - from[1]) - (to[1] - from[1]) * (point[0] - from[0]);
    if (turn < 0) inside = false;
    const distance = Math.hypot(...fromEdge<Vec2>(from, to, point));
    if (distance < least) [least, edge] = [distance, i];
  }
  return { metres: inside ? least : -least, edge };
}

/** The vector from the nearest point on a segment to a point, in a plane or in space. */
export function fromEdge<V extends Vec2 | Vec3>(from: V, to: V, point: V): V {
  let [along, squared] = [0, 0];
  for (let i = 0; i < from.length; i += 1) {
    const edge = to[i]! - from[i]!;
    along += (point[i]! - from[i]!) * edge;
    squared += edge * edge;
  }
  const part = squared > 0 ? Math.min(1, Math.max(0, along / squared)) : 0;
  return point.map((x, i) => x - from[i]! - part * (to[i]! - from[i]!)) as readonly number[] as V;
}
