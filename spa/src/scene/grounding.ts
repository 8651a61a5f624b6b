/**
 * How low a robot reaches: the bottom of its links' bounding boxes in the world, without allocating.
 *
 * A box with centre c and half sizes h, seen through the transform M, has its lowest point at
 * (M·c).z − Σᵢ |M[z,i]|·hᵢ. Exact for boxes, at most a little low for round links; feet are flat.
 */

/** Axis-aligned in the link's own frame, metres. */
export interface LinkBox {
  min: [number, number, number];
  max: [number, number, number];
}

/** A column-major 4×4 transform, as three.js keeps it: world_from_link. */
export type Elements = ArrayLike<number>;

export function emptyBox(): LinkBox {
  return {
    min: [Number.POSITIVE_INFINITY, Number.POSITIVE_INFINITY, Number.POSITIVE_INFINITY],
    max: [Number.NEGATIVE_INFINITY, Number.NEGATIVE_INFINITY, Number.NEGATIVE_INFINITY],
  };
}

/** Grows the box by points (x, y, z after one another) that lie in a frame seen from the link through `m`. */
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

export function lowestZ(box: LinkBox, m: Elements): number {
  let z = m[14]!;
  for (let i = 0; i < 3; i += 1) {
    const along = m[i * 4 + 2]!;
    const centre = (box.min[i]! + box.max[i]!) / 2;
    const half = (box.max[i]! - box.min[i]!) / 2;
    z += along * centre - Math.abs(along) * half;
  }
  return z;
}
