/**
 * A software rasteriser with a depth buffer of 1/w and one table look-up per pixel for the colour. Without a GPU this
 * is several times faster than filling canvas paths, and triangles need not be sorted.
 *
 * Pixels are 0xAABBGGRR, as a canvas keeps them on every machine that browsers run on.
 */

/** Steps from dark to bright in a table of colours. */
export const SHADES = 256;
/** Period of the hatching, pixels. */
const HATCH_PIXELS = 7;

/** Projected vertices: x, y in pixels, 1/w (larger is nearer; 0 or less is behind the camera), shade 0…255. */
export interface Corners {
  readonly x: Float32Array;
  readonly y: Float32Array;
  readonly inverseW: Float32Array;
  readonly shade: Float32Array;
}

/** Factor by which 1/w must be larger to count as nearer than a surface that may be shared (see `clearBefore`). */
const HAIR = 1.004;

/** Ordered 4 × 4 dither, in sixteenths: the same pattern as the 3D view's. */
const DITHER = Uint8Array.from([0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5]);

export class Rasterizer {
  width = 0;
  height = 0;
  pixels = new Uint32Array();
  #bytes = new Uint8ClampedArray<ArrayBuffer>(new ArrayBuffer(0));
  #depth = new Float32Array();
  #memory = new ArrayBuffer(0);
  #depths = new Float32Array();

  /** The pixels as RGBA bytes, for `putImageData`. */
  get bytes(): Uint8ClampedArray<ArrayBuffer> {
    return this.#bytes;
  }

  /** Sets the size in pixels; the content is undefined afterwards. The memory never shrinks: pictures alternate between
   *  the sizes for motion and rest, and each change would leave megabytes of garbage. */
  resize(width: number, height: number): void {
    if (width === this.width && height === this.height) return;
    this.width = width;
    this.height = height;
    const size = width * height;
    if (size * 4 > this.#memory.byteLength) {
      this.#memory = new ArrayBuffer(size * 4);
      this.#depths = new Float32Array(size);
    }
    this.pixels = new Uint32Array(this.#memory, 0, size);
    this.#bytes = new Uint8ClampedArray(this.#memory, 0, size * 4);
    this.#depth = this.#depths.subarray(0, size);
  }

  /** Clears to transparent, with an empty depth buffer. */
  clear(): void {
    this.pixels.fill(0);
    this.#depth.fill(0);
  }

  /** Clears to transparent with the depth of `other`, moved a little nearer: for a body that shares surfaces with the other one
   *  and is drawn only where it is clearly in front. */
  clearBefore(other: Rasterizer): void {
    this.resize(other.width, other.height);
    this.pixels.fill(0);
    const [depth, before] = [this.#depth, other.#depth];
    for (let i = 0; i < depth.length; i += 1) depth[i] = before[i]! * HAIR;
  }

  /** Blends another picture of the same size over this one, by its opacity. */
  overlay({ pixels: above }: Rasterizer): void {
    const { pixels } = this;
    for (let i = 0; i < pixels.length; i += 1) {
      const over = above[i]!;
      if (over === 0) continue;
      const under = pixels[i]!;
      if (under === 0) {
        pixels[i] = over;
        continue;
      }
      const part = over >>> 24;
      const keep = 255 - part;
      const mix = (shift: number) =>
        ((((over >> shift) & 255) * part + ((under >> shift) & 255) * keep) / 255) | 0;
      pixels[i] = ((255 << 24) | (mix(16) << 16) | (mix(8) << 8) | mix(0)) >>> 0;
    }
  }

  /**
   * Draws the triangles `index[start … start + count]`. `rowOfCorner` of a triangle's first corner names its row of
   * `tables` (SHADES colours), in which the shade picks the colour. Back faces get `backPart` of their shade, since
   * meshes may be open. `seen` 0…1 is the opacity; `hatch` takes every other stripe from the next row. Returns how many
   * triangles were on the screen.
   */
  draw(
    corners: Corners,
    index: Uint32Array,
    start: number,
    count: number,
    tables: Uint32Array,
    rowOfCorner: (corner: number) => number,
    seen = 1,
    hatch = false,
    backPart = 0.35,
  ): number {
    const { x: xs, y: ys, inverseW: ws, shade } = corners;
    const { width, height, pixels } = this;
    const depth = this.#depth;
    const plain = seen >= 1 && !hatch;
    let drawn = 0;
    for (let at = start; at < start + count; at += 3) {
      const i = index[at]!;
      let j = index[at + 1]!;
      let k = index[at + 2]!;
      const wi = ws[i]!;
      if (wi <= 0 || ws[j]! <= 0 || ws[k]! <= 0) continue;
      const xi = xs[i]!;
      const yi = ys[i]!;
      let area = (xs[j]! - xi) * (ys[k]! - yi) - (xs[k]! - xi) * (ys[j]! - yi);
      const back = area > 0; // the screen's y points down
      if (!back) {
        [j, k] = [k, j];
        area = -area;
      }
      if (area < 1e-3) continue;
      const xj = xs[j]!;
      const yj = ys[j]!;
      const xk = xs[k]!;
      const yk = ys[k]!;
      const top = Math.max(0, Math.ceil(Math.min(yi, yj, yk) - 0.5));
      const bottom = Math.min(height - 1, Math.floor(Math.max(yi, yj, yk) - 0.5));
      if (top > bottom || Math.max(xi, xj, xk) < 0 || Math.min(xi, xj, xk) > width) continue;
      drawn += 1;

      // Planes of 1/w and shade over the screen.
      const scale = 1 / area;
      const wj = ws[j]!;
      const wk = ws[k]!;
      const wx = ((wj - wi) * (yk - yi) - (wk - wi) * (yj - yi)) * scale;
      const wy = ((wk - wi) * (xj - xi) - (wj - wi) * (xk - xi)) * scale;
      const dim = back ? backPart : 1;
      const si = shade[i]! * dim;
      const sj = shade[j]! * dim;
      const sk = shade[k]! * dim;
      const sx = ((sj - si) * (yk - yi) - (sk - si) * (yj - yi)) * scale;
      const sy = ((sk - si) * (xj - xi) - (sj - si) * (xk - xi)) * scale;
      const least = Math.min(si, sj, sk);
      const most = Math.max(si, sj, sk);
      const row = rowOfCorner(i) * SHADES;

      for (let y = top; y <= bottom; y += 1) {
        const cy = y + 0.5;
        // Where this row enters and leaves the triangle: one bound from each edge.
        let left = 0;
        let right = width - 1;
        for (let edge = 0; edge < 3; edge += 1) {
          const ax = edge === 0 ? xi : edge === 1 ? xj : xk;
          const ay = edge === 0 ? yi : edge === 1 ? yj : yk;
          const bx = edge === 0 ? xj : edge === 1 ? xk : xi;
          const by = edge === 0 ? yj : edge === 1 ? yk : yi;
          const dy = by - ay;
          if (dy === 0) continue;
          const cross = ax + ((cy - ay) * (bx - ax)) / dy - 0.5;
          if (dy < 0) left = Math.max(left, Math.ceil(cross));
          else right = Math.min(right, Math.ceil(cross) - 1);
        }
        if (left > right) continue;
        const from = y * width;
        let w = wi + (left + 0.5 - xi) * wx + (cy - yi) * wy;
        let s = si + (left + 0.5 - xi) * sx + (cy - yi) * sy;
        for (let x = left; x <= right; x += 1, w += wx, s += sx) {
          const pixel = from + x;
          if (w <= depth[pixel]!) continue;
          if (plain) {
            depth[pixel] = w;
            pixels[pixel] = tables[row + (Math.min(most, Math.max(least, s)) | 0)]!;
            continue;
          }
          if (seen * 16 <= DITHER[(y & 3) * 4 + (x & 3)]!) continue;
          depth[pixel] = w;
          const striped = hatch && (x + y) % HATCH_PIXELS < 3 ? SHADES : 0;
          pixels[pixel] = tables[row + striped + (Math.min(most, Math.max(least, s)) | 0)]!;
        }
      }
    }
    return drawn;
  }
}
