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
