/** Twice the area (m²) that a corner spans with its neighbours at least. Two feet side by side have corners on one line,
 *  but for rounding. */
const SLIVER_M2 = 1e-9;

/**
 * The convex hull of up to `most` points in a plane: Andrew's monotone chain (1979), without allocating. Points are
 * sorted by insertion, from the order of the time before on, which is almost right for feet that move on.
 */
export class ConvexHull {
  /** Indices of the hull's corners among the points, counter-clockwise, from the one with the least x (then y) on. */
  readonly corners: Int32Array;
  count = 0;
  /** The points by x, then y: a permutation of 0 … `#size` − 1. */
  readonly #order: Int32Array;
  #size = 0;

  constructor(most: number) {
    this.corners = new Int32Array(2 * most + 1);
    this.#order = new Int32Array(most);
  }

  /** Takes `points` (x, y, x, y, …; `size` points) and writes `corners` and `count`. Corners on a straight edge and
   *  repeated ones are left out: points on one line have a hull of 2, equal ones of 1. */
  update(points: Float64Array, size: number): void {
    const order = this.#order;
    if (size !== this.#size) for (let i = 0; i < size; i += 1) order[i] = i;
    this.#size = size;
    for (let i = 1; i < size; i += 1) {
      const point = order[i]!;
      let at = i;
      for (; at > 0 && isAfter(points, order[at - 1]!, point); at -= 1) order[at] = order[at - 1]!;
      order[at] = point;
    }
    this.count = 0;
    for (let i = 0; i < size; i += 1) this.#push(points, order[i]!, 0);
    const lower = this.count - 1;
    for (let i = size - 2; i >= 0; i -= 1) this.#push(points, order[i]!, Math.max(0, lower));
    if (this.count > 1 && areEqual(points, this.corners[0]!, this.corners[this.count - 1]!)) this.count -= 1;
    this.#dropSlivers(points);
  }

  /** Drops corners on a straight edge that both chains begin or end with: of an edge along y, rounding says which point
   *  is the first. */
  #dropSlivers(points: Float64Array): void {
    const { corners, count } = this;
    let kept = 0;
    for (let i = 0; i < count; i += 1) {
      const before = corners[kept > 0 ? kept - 1 : count - 1]!;
      const after = corners[i + 1 < count ? i + 1 : 0]!;
      const isNone = turnOf(points, before, corners[i]!, after) <= SLIVER_M2;
      if (isNone && this.count > 2) this.count -= 1;
      else {
        corners[kept] = corners[i]!;
        kept += 1;
      }
    }
  }

  /** Adds a point to the chain that begins at `start`, and drops what is then no corner. */
  #push(points: Float64Array, point: number, start: number): void {
    const { corners } = this;
    while (this.count - start >= 2) {
      if (turnOf(points, corners[this.count - 2]!, corners[this.count - 1]!, point) > SLIVER_M2) break;
      this.count -= 1;
    }
    if (this.count > 0 && areEqual(points, corners[this.count - 1]!, point)) return;
    corners[this.count] = point;
    this.count += 1;
  }
}

function isAfter(points: Float64Array, a: number, b: number): boolean {
  const across = points[2 * a]! - points[2 * b]!;
  return across > 0 || (across === 0 && points[2 * a + 1]! > points[2 * b + 1]!);
}

function areEqual(points: Float64Array, a: number, b: number): boolean {
  return points[2 * a] === points[2 * b] && points[2 * a + 1] === points[2 * b + 1];
}

/** Twice the area of the triangle a, b, c: positive when it turns counter-clockwise. */
function turnOf(points: Float64Array, a: number, b: number, c: number): number {
  const [ax, ay] = [points[2 * a]!, points[2 * a + 1]!];
  return (
    (points[2 * b]! - ax) * (points[2 * c + 1]! - ay) - (points[2 * b + 1]! - ay) * (points[2 * c]! - ax)
  );
}
