import type { Vec3 } from '../../../twin/rotation.ts';
import type { FacetLayout, FacetNumbers } from '../facet_numbers.ts';
import { type Paint, PictureNumbers, tintOf } from '../picture_numbers.ts';

/** Maximum facets in one picture; further ones are not drawn. The balance of one robot takes about 1,000. */
export const MOST_FACETS = 8192;

/** `through` comes after the four numbers of `tint`. */
export const FACET_AT: FacetLayout = { first: 0, second: 3, third: 6, tint: 9, through: 13 };
export const FACET_STRIDE = 14;

/** Filled triangles of an overlay, independent of the renderer: the counterpart of `Strokes` for areas. */
export class Facets extends PictureNumbers implements FacetNumbers {
  readonly at = FACET_AT;

  constructor() {
    super(MOST_FACETS, FACET_STRIDE);
  }

  /** Adds a triangle, its corners counter-clockwise as seen by the viewer. */
  add(a: Vec3, b: Vec3, c: Vec3, paint: Paint): void {
    if (this.isFull) return;
    this.making.set([...a, ...b, ...c], this.made * FACET_STRIDE + FACET_AT.first);
    this.#paint(paint);
  }

  /** Adds a shape of many triangles, nine numbers each: rotated about the vertical (rad), scaled and moved to a point. */
  addShape(corners: ArrayLike<number>, [x, y, z]: Vec3, size: number, heading: number, paint: Paint): void {
    const [c, s] = [size * Math.cos(heading), size * Math.sin(heading)];
    const to = this.making;
    for (let from = 0; from < corners.length && !this.isFull; from += 9) {
      const at = this.made * FACET_STRIDE + FACET_AT.first;
      for (let i = 0; i < 9; i += 3) {
        const [px, py] = [corners[from + i]!, corners[from + i + 1]!];
        to[at + i] = x + c * px - s * py;
        to[at + i + 1] = y + s * px + c * py;
        to[at + i + 2] = z + size * corners[from + i + 2]!;
      }
      this.#paint(paint);
    }
  }

  /** Completes the facet whose corners have been written. */
  #paint(paint: Paint): void {
    this.making.set([...tintOf(paint), paint.through ? 1 : 0], this.made * FACET_STRIDE + FACET_AT.tint);
    this.made += 1;
  }
}
