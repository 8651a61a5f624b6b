import { OVERLAY_COLORS, type OverlayColors } from '../signs/colors.ts';

/** Red, green, blue in sRGB, 0…255. */
export type Rgb = readonly [number, number, number];

/** The colours of the light view: the 3D view's theme, converted for a 2D canvas. */
export interface LightColors {
  /** The page's background, to which the floor fades. */
  readonly page: Rgb;
  readonly floor: Rgb;
  readonly minorLine: Rgb;
  readonly majorLine: Rgb;
  readonly muted: Rgb;
  readonly accent: Rgb;
  readonly caution: Rgb;
  /** Tint of a robot whose pose is old. */
  readonly stale: Rgb;
  /** Colours of the overlay. */
  readonly signs: OverlayColors;
  /** How dark a full shadow is, 0…1. */
  readonly shadow: number;
  /** Luminance of the ambient light from above (`sky`) and below (`bounce`), and the strengths of both lamps. */
  readonly sky: number;
  readonly bounce: number;
  readonly key: number;
  readonly fill: number;
}

/** Splits sRGB 0xrrggbb into its components. */
export function rgbOf(color: number): Rgb {
  return [color >> 16, (color >> 8) & 255, color & 255];
}

function ofSigns(signs: OverlayColors) {
  const { muted, accent, caution, stale } = signs;
  return { signs, muted: rgbOf(muted), accent: rgbOf(accent), caution: rgbOf(caution), stale: rgbOf(stale) };
}

export const LIGHT_COLORS: Readonly<Record<'dark' | 'light', LightColors>> = {
  dark: {
    ...ofSigns(OVERLAY_COLORS.dark),
    page: [0x0e, 0x11, 0x16],
    floor: [0x22, 0x2a, 0x35],
    minorLine: [0x2b, 0x35, 0x43],
    majorLine: [0x45, 0x52, 0x66],
    shadow: 0.72,
    sky: 0.92,
    bounce: 0.062,
    key: 2.1,
    fill: 0.55,
  },
  light: {
    ...ofSigns(OVERLAY_COLORS.light),
    page: [0xf7, 0xf8, 0xfa],
    floor: [0xff, 0xff, 0xff],
    minorLine: [0xe3, 0xe7, 0xed],
    majorLine: [0xc3, 0xca, 0xd4],
    shadow: 0.3,
    sky: 1.35,
    bounce: 0.83,
    key: 1.9,
    fill: 0.5,
  },
};

export function css([r, g, b]: Rgb, alpha = 1): string {
  return `rgb(${r} ${g} ${b} / ${alpha})`;
}

/** An opaque canvas pixel, 0xAABBGGRR, from components 0…255. */
export function pixel(r: number, g: number, b: number): number {
  return ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
}

/** Encodes linear light as sRGB; both 0…1 (IEC 61966-2-1). */
export function encoded(linear: number): number {
  const value = Math.min(1, Math.max(0, linear));
  return value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
}

/** Decodes sRGB to linear light; both 0…1 (IEC 61966-2-1). */
export function linear(shown: number): number {
  return shown <= 0.04045 ? shown / 12.92 : ((shown + 0.055) / 1.055) ** 2.4;
}
