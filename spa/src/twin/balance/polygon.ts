import type { Vec3 } from '../rotation.ts';
import type { FootBalance, Vec2 } from './balance.ts';

/** Minimum of twice the area (m²) between a corner and its neighbours. Two feet side by side have collinear corners except for
 *  rounding. */
const SLIVER_M2 = 1e-9;

/**
 * The convex hull of points in a plane: Andrew's monotone chain (1979). The indices of its corners, counter-clockwise, starting
 * with the smallest x (then y). Corners on a straight edge and repeated ones are left out: collinear points have a hull of 2
 * corners, equal points one of 1.
 */
export function convexHull(points: readonly Vec2[]): number[] {
  const order = points
    .map((_, i) => i)
    .sort((a, b) => points[a]![0] - points[b]![0] || points[a]![1] - points[b]![1])
    .filter((point, i, all) => i === 0 || points[point]!.some((x, axis) => x !== points[all[i - 1]!]![axis]));
  if (order.length < 2) return order;
  const corners = chain(points, order);
  corners.push(...chain(points, order.reverse()));
  // Both chains may begin or end with a corner on a straight edge: for an edge along y, rounding decides which point comes first.
  for (let i = 0; i < corners.length && corners.length > 2; ) {
    const after = corners[(i + 1) % corners.length]!;
    if (turnOf(points, corners.at(i - 1)!, corners[i]!, after) > SLIVER_M2) i += 1;
    else corners.splice(i, 1);
  }
  return corners;
}

/** The area spanned by feet on the floor: the convex hull of their corners. */
export function spanOf(feet: readonly Pick<FootBalance, 'corners'>[]): Vec2[] {
  const points = feet.flatMap(({ corners }) => corners.map(([x, y]): Vec2 => [x, y]));
  return convexHull(points).map((i) => points[i]!);
}

/** The corners on one side, without the last one, which begins the other side. */
function chain(points: readonly Vec2[], order: readonly number[]): number[] {
  const corners: number[] = [];
  for (const point of order) {
    while (corners.length > 1 && turnOf(points, corners.at(-2)!, corners.at(-1)!, point) <= SLIVER_M2)
      corners.pop();
    corners.push(point);
  }
  corners.pop();
  return corners;
}

/** Twice the area of the triangle a, b, c: positive if it turns counter-clockwise. */
function turnOf(points: readonly Vec2[], a: number, b: number, c: number): number {
  const [ax, ay] = points[a]!;
  const [bx, by] = points[b]!;
  const [cx, cy] = points[c]!;
  return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
}

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
