import type { FootBalance, Vec2 } from './balance.ts';

/** Twice the area (m²) that a corner spans with its neighbours at least. Two feet side by side have corners on one line,
 *  but for rounding. */
const SLIVER_M2 = 1e-9;

/**
 * The convex hull of points in a plane: Andrew's monotone chain (1979). The indices of its corners, counter-clockwise,
 * from the one with the least x (then y) on. Corners on a straight edge and repeated ones are left out: points on one
 * line have a hull of 2, equal ones of 1.
 */
export function convexHull(points: readonly Vec2[]): number[] {
  const order = points
    .map((_, i) => i)
    .sort((a, b) => points[a]![0] - points[b]![0] || points[a]![1] - points[b]![1])
    .filter((point, i, all) => i === 0 || points[point]!.some((x, axis) => x !== points[all[i - 1]!]![axis]));
  if (order.length < 2) return order;
  const corners = chain(points, order);
  corners.push(...chain(points, order.reverse()));
  // Both chains may begin or end with a corner on a straight edge: of an edge along y, rounding says which point is the
  // first.
  for (let i = 0; i < corners.length && corners.length > 2; ) {
    const after = corners[(i + 1) % corners.length]!;
    if (turnOf(points, corners.at(i - 1)!, corners[i]!, after) > SLIVER_M2) i += 1;
    else corners.splice(i, 1);
  }
  return corners;
}

/** What feet span on the floor: the convex hull of their corners. */
export function spanOf(feet: readonly Pick<FootBalance, 'corners'>[]): Vec2[] {
  const points = feet.flatMap(({ corners }) => corners.map(([x, y]): Vec2 => [x, y]));
  return convexHull(points).map((i) => points[i]!);
}

/** The corners on one side, without the last, with which the other side begins. */
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

/** Twice the area of the triangle a, b, c: positive when it turns counter-clockwise. */
function turnOf(points: readonly Vec2[], a: number, b: number, c: number): number {
  const [ax, ay] = points[a]!;
  const [bx, by] = points[b]!;
  const [cx, cy] = points[c]!;
  return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
}
