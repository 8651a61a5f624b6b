import { STAND_IN } from '../../model/lod.ts';
import type { LinkLook, LinkTint } from '../../model/posed_body.ts';
import { encoded, type LightColors, linear, pixel, rgbOf } from './colors.ts';
import { SHADES } from './rasterizer.ts';

/** Unit vectors (world) towards the lamps, in the same places as in the 3D view. */
export const KEY = unit(2, 0.7, 4.1);
export const FILL = unit(-0.5, -3, 0.7);
/** The light (1 shows a surface's full colour) at which the tables end. */
const BRIGHTEST = 1.15;
/** Base opacity of glass. */
const GLASS = 0.35;
/** Mask that rounds load colours, so that there are fewer tables. */
const FEWER_COLORS = 0xfcfcfc;
/** Tables are made on demand; beyond this many rows, all are dropped and rebuilt. */
const MOST_TABLES = 512;

/** Shades per unit of light; a matt (Lambertian) surface reflects 1/π of the light it receives. */
export const SHADES_PER_LIGHT = (SHADES - 1) / (Math.PI * BRIGHTEST);

/** Look-up tables from paint and shade to pixel. Each look of a link has two rows for each paint: the plain colour and
 *  the colour of its hatching. */
export class Tables {
  /** Rows of SHADES pixels each, 0xAABBGGRR. */
  colors = new Uint32Array();
  #tones: LightColors;
  #paints: Float32Array;
  #rows = new Map<string, number>();

  /** `paints`: linear red, green, blue and opacity of each paint, as in `Lod.paints`. */
  constructor(paints: Float32Array, tones: LightColors) {
    this.#paints = paints;
    this.#tones = tones;
  }

  setTones(tones: LightColors): void {
    this.#tones = tones;
    this.#forget();
  }

  /** The first row of this look; the row of paint p is `2 · p` further. */
  firstRow({ highlight = 0 }: LinkLook): number {
    const glow = glowOf(highlight);
    return this.#made(`${glow}`, this.#paints.length / 4, (into, at, paint) => {
      const color = [...this.#paints.subarray(paint * 4, paint * 4 + 3)];
      if (this.isStandIn(paint)) this.#fillStandIn(into, at, glow);
      else this.#fill(into, at, color, glow, 0.66);
    });
  }

  /** The row of a link that is painted in a single colour instead of its own paints. */
  tintRow({ color }: LinkTint, { highlight = 0 }: LinkLook): number {
    const glow = glowOf(highlight);
    const shown = color & FEWER_COLORS;
    return this.#made(`${glow} ${shown}`, 1, (into, at) => {
      this.#fill(
        into,
        at,
        rgbOf(shown).map((part) => linear(part / 255)),
        glow,
        0.35,
      );
    });
  }

  /** The row of glass. Its shade depends on the angle between surface and camera: transparent facing the camera, dense at
   *  edges. */
  glassRow(): number {
    return this.#made('glass', 1, (into, at) => {
      const [r, g, b] = this.#tones.accent;
      for (let i = 0; i < SHADES; i += 1) {
        const edge = 1 - i / (SHADES - 1);
        const layer = GLASS * (0.4 + 2 * edge * edge);
        const opacity = Math.round(255 * Math.min(1, 1 - (1 - layer) ** 2)); // front and back of a shell
        const light = Math.min(1, 0.82 + 0.25 * edge);
        into[at + i] = ((opacity << 24) | (pixel(r * light, g * light, b * light) & 0xffffff)) >>> 0;
      }
    });
  }

  isStandIn(paint: number): boolean {
    return this.#paints[paint * 4 + 3] === STAND_IN;
  }

  #forget(): void {
    this.#rows.clear();
    this.colors = new Uint32Array();
  }

  /** The first row of a named table; made with `fill` if it is missing. Each of `count` paints has two rows. */
  #made(name: string, count: number, fill: (into: Uint32Array, at: number, paint: number) => void): number {
    let first = this.#rows.get(name);
    if (first !== undefined) return first;
    if (this.colors.length / SHADES + 2 * count > Math.max(MOST_TABLES, 2 * count)) this.#forget();
    first = this.colors.length / SHADES;
    const grown = new Uint32Array(this.colors.length + 2 * count * SHADES);
    grown.set(this.colors);
    for (let paint = 0; paint < count; paint += 1) fill(grown, (first + 2 * paint) * SHADES, paint);
    this.colors = grown;
    this.#rows.set(name, first);
    return first;
  }

  /** Fills the two rows of a paint. `color`: linear, 0…1; `stripe`: brightness of the hatching. */
  #fill(into: Uint32Array, at: number, color: readonly number[], glow: number, stripe: number): void {
    const accent = this.#tones.accent.map((part) => linear(part / 255));
    for (let i = 0; i < SHADES; i += 1) {
      const light = (i / (SHADES - 1)) * BRIGHTEST;
      const rgb = color.map((part, c) => {
        const lit = part * light;
        return encoded(lit + (accent[c]! * (0.55 + 0.35 * light) - lit * 0.35) * glow);
      });
      into[at + i] = packed(rgb);
      into[at + SHADES + i] = packed(rgb.map((part) => part * stripe));
    }
  }

  /** Fills the two rows of a missing mesh's placeholder: dark, with stripes in the caution colour. */
  #fillStandIn(into: Uint32Array, at: number, glow: number): void {
    this.#fill(into, at, [0.25, 0.25, 0.25], glow, 1);
    for (let i = 0; i < SHADES; i += 1) {
      const light = Math.sqrt((i / (SHADES - 1)) * BRIGHTEST);
      into[at + SHADES + i] = packed(this.#tones.caution.map((part) => (part / 255) * light));
    }
  }
}

function glowOf(highlight: number): number {
  return Math.round(highlight * 8) / 8;
}

function packed([r, g, b]: readonly number[]): number {
  const byte = (part: number | undefined) => Math.round(Math.min(1, Math.max(0, part ?? 0)) * 255);
  return pixel(byte(r), byte(g), byte(b));
}

function unit(x: number, y: number, z: number): readonly [number, number, number] {
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}
