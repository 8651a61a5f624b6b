import type { Rgb } from './colors.ts';

const HATCH_CSS_PIXELS = 9;

/**
 * Greys and hatches everything that was drawn by `amount` (0…1), in place, as the 3D view does. Opacity is unchanged.
 *
 * `pixels` are 0xAABBGGRR, transparent where nothing was drawn; `ratio` is pixels per CSS pixel.
 */
export function applyStaleEffect(
  pixels: Uint32Array,
  width: number,
  amount: number,
  { 0: r, 1: g, 2: b }: Rgb,
  ratio: number,
): void {
  const period = Math.max(3, Math.round(HATCH_CSS_PIXELS * ratio));
  const stripe = Float32Array.from({ length: period }, (_, i) => {
    const across = Math.abs(i / period - 0.5) * 2;
    const hatch = Math.min(1, Math.max(0, (across - 0.62) / 0.24));
    return 0.92 - 0.3 * hatch * hatch * (3 - 2 * hatch);
  });
  const keep = 256 - Math.round(amount * 256);
  const part = 256 - keep;
  for (let at = 0, x = 0, y = 0; at < pixels.length; at += 1) {
    const color = pixels[at]!;
    if (color !== 0) {
      const red = color & 255;
      const green = (color >> 8) & 255;
      const blue = (color >> 16) & 255;
      const luma = (red * 54 + green * 183 + blue * 19) >> 8;
      const dim = stripe[(x + y) % period]!;
      const grey = luma * 0.65 * dim;
      const tone = 0.35 * dim;
      const newRed = (red * keep + (grey + r * tone) * part) >> 8;
      const newGreen = (green * keep + (grey + g * tone) * part) >> 8;
      const newBlue = (blue * keep + (grey + b * tone) * part) >> 8;
      pixels[at] = ((color & 0xff000000) | (newBlue << 16) | (newGreen << 8) | newRed) >>> 0;
    }
    x += 1;
    if (x === width) {
      x = 0;
      y += 1;
    }
  }
}
