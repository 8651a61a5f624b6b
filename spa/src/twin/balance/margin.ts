import type { Vec2 } from './balance.ts';

/** Where a point lies to a polygon. */
export interface Margin {
  /** Distance to the nearest edge, metres; positive inside, negative outside, 0 on it. */
  metres: number;
  /** The index of the corner where that edge begins; the first of several that are equally near. */
  edge: number;
}

/** Writes how far a point (x, y) is inside a convex, counter-clockwise polygon of at least one corner. A polygon of one
 *  or two corners has no inside. */
export function writeMargin(polygon: readonly Vec2[], x: number, y: number, into: Margin): void {
  let inside = polygon.length > 2;
  let least = Number.POSITIVE_INFINITY;
  for (let i = 0; i < polygon.length; i += 1) {
    const [ax, ay] = polygon[i]!;
    const [bx, by] = polygon[i + 1 === polygon.length ? 0 : i + 1]!;
    const [ex, ey] = [bx - ax, by - ay];
    const [px, py] = [x - ax, y - ay];
    if (ex * py - ey * px < 0) inside = false;
    const squared = ex * ex + ey * ey;
    const along = squared > 0 ? Math.min(1, Math.max(0, (px * ex + py * ey) / squared)) : 0;
    const distance = Math.hypot(px - along * ex, py - along * ey);
    if (distance < least) {
      least = distance;
      into.edge = i;
    }
  }
  into.metres = inside ? least : -least;
}
