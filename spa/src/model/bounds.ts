/**
 * The lowest point of a robot: the bottom of its links' bounding boxes in the world, computed without allocating.
 *
 * A box with centre c and half sizes h, seen through the transform M, has its lowest point at (M·c).z − Σᵢ |M[z,i]|·hᵢ. Exact for
 * boxes, at most a little low for round links; feet are flat.
 */

/** A bounding box, axis-aligned in the link's own frame, metres. */
export interface LinkBox {
  min: [number, number, number];
  max: [number, number, number];
}

/** A column-major 4×4 transform, as three.js keeps it: world_from_link. */
export type Elements = ArrayLike<number>;

/** An empty box (min +∞, max −∞), to be grown. */
export function emptyBox(): LinkBox {
  return {
    min: [Number.POSITIVE_INFINITY, Number.POSITIVE_INFINITY, Number.POSITIVE_INFINITY],
    max: [Number.NEGATIVE_INFINITY, Number.NEGATIVE_INFINITY, Number.NEGATIVE_INFINITY],
  };
}

/** Grows the box by points (x, y, z, x, y, z, …), which `m` transforms into the link's frame. */
export function growBox(box: LinkBox, points: ArrayLike<number>, m: Elements): void {
  for (let i = 0; i + 2 < points.length; i += 3) {
    const x = points[i]!;
    const y = points[i + 1]!;
    const z = points[i + 2]!;
    for (let row = 0; row < 3; row += 1) {
      const value = m[row]! * x + m[row + 4]! * y + m[row + 8]! * z + m[row + 12]!;
      if (value < box.min[row]!) box.min[row] = value;
      if (value > box.max[row]!) box.max[row] = value;
    }
  }
}

/** The lowest z of a box transformed by the 16 numbers from index `at` on in `m`. */
export function lowestZ(box: LinkBox, m: Elements, at = 0): number {
  let z = m[at + 14]!;
  for (let i = 0; i < 3; i += 1) {
    const along = m[at + i * 4 + 2]!;
    const centre = (box.min[i]! + box.max[i]!) / 2;
    const half = (box.max[i]! - box.min[i]!) / 2;
    z += along * centre - Math.abs(along) * half;
  }
  return z;
}

/** The lowest z of a robot, metres, by its links' boxes, or by link origins if there are no boxes. `fromLink` has a
 *  transform of 16 numbers for each link; `boxes` go by link index. */
export function lowestOf(fromLink: Float64Array, boxes: ReadonlyMap<number, LinkBox>): number {
  let low = Number.POSITIVE_INFINITY;
  for (const [link, box] of boxes) low = Math.min(low, lowestZ(box, fromLink, link * 16));
  if (boxes.size === 0) for (let i = 14; i < fromLink.length; i += 16) low = Math.min(low, fromLink[i]!);
  return low;
}

/** Calls `see` with a box's eight corners, transformed by the 16 numbers from index `at` on in `m`. */
export function cornersOf(
  box: LinkBox,
  m: Elements,
  at: number,
  see: (x: number, y: number, z: number) => void,
): void {
  for (let corner = 0; corner < 8; corner += 1) {
    const x = (corner & 1 ? box.max : box.min)[0];
    const y = (corner & 2 ? box.max : box.min)[1];
    const z = (corner & 4 ? box.max : box.min)[2];
    const row = (i: number) => m[at + i]! * x + m[at + i + 4]! * y + m[at + i + 8]! * z + m[at + i + 12]!;
    see(row(0), row(1), row(2));
  }
}

/** Grows `min` and `max` by a box's corners, transformed by the 16 numbers from index `at` on in `m`. */
export function expandByBox(min: number[], max: number[], box: LinkBox, m: Elements, at: number): void {
  cornersOf(box, m, at, (...point) => {
    for (const [axis, value] of point.entries()) {
      min[axis] = Math.min(min[axis]!, value);
      max[axis] = Math.max(max[axis]!, value);
    }
  });
}

/** The lowest and highest corner (world, metres) of all link boxes and link origins. */
export function boundsOf(worldFromLink: Float64Array, boxes: ReadonlyMap<number, LinkBox>): LinkBox {
  const { min, max } = emptyBox();
  for (const [link, box] of boxes) expandByBox(min, max, box, worldFromLink, link * 16);
  for (let at = 12; at < worldFromLink.length; at += 16) {
    for (let axis = 0; axis < 3; axis += 1) {
      min[axis] = Math.min(min[axis]!, worldFromLink[at + axis]!);
      max[axis] = Math.max(max[axis]!, worldFromLink[at + axis]!);
    }
  }
  return { min, max };
}

/** A body counts as long if its length is this many times its width and height: a snake, a train, an outstretched arm. */
const LONG = 3;

/** The extent of the camera's subject, metres: half its height, half its width from any side, and its radius. `lies`: the axis
 *  that a long body lies along; absent for all others. */
export interface Extent {
  readonly tall: number;
  readonly wide: number;
  readonly radius: number;
  readonly lies?: 'x' | 'y';
}

/** The extent of a box; its radius is kept between 2 cm and 200 m. */
export function extentOf(
  min: readonly [number, number, number],
  max: readonly [number, number, number],
): Extent {
  const [x, y, z] = [max[0] - min[0], max[1] - min[1], max[2] - min[2]];
  const lies = x > LONG * Math.max(y, z) ? 'x' : y > LONG * Math.max(x, z) ? 'y' : null;
  return {
    ...(lies === null ? {} : { lies }),
    tall: z / 2,
    wide: Math.hypot(x, y) / 2,
    radius: Math.min(Math.max(Math.hypot(x, y, z) / 2, 0.02), 200),
  };
}
