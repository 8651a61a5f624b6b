import { Color } from 'three';
import { OVERLAY_COLORS, type OverlayColors } from '../signs/colors.ts';

export type ThemeName = 'dark' | 'light';

/** The colours of the scene. The page's own tokens are repeated here because a canvas can't inherit CSS; the rest are the
 *  scene's. */
export interface SceneTheme {
  /** The page's background, to which the floor fades. */
  page: Color;
  /** The floor where light falls on it, just under the robot. */
  floor: Color;
  minorLine: Color;
  majorLine: Color;
  /** How dark a full shadow is, 0…1. */
  shadow: number;
  /** How dark it is under a sole, 0…1. */
  contact: number;
  /** Colours of the overlay. */
  signs: OverlayColors;
  caution: Color;
  /** Selection and highlight. */
  accent: Color;
  /** Lines of the skeleton. */
  muted: Color;
  /** Tint of a robot whose pose is old. */
  stale: Color;
  sky: Color;
  bounce: Color;
  hemisphere: number;
  key: number;
  fill: number;
  exposure: number;
}

const hex = (value: number) => new Color(value);

function ofSigns(signs: OverlayColors) {
  const { caution, accent, muted, stale } = signs;
  return { signs, caution: hex(caution), accent: hex(accent), muted: hex(muted), stale: hex(stale) };
}

export const THEMES: Readonly<Record<ThemeName, SceneTheme>> = {
  dark: {
    ...ofSigns(OVERLAY_COLORS.dark),
    page: hex(0x0e1116),
    floor: hex(0x222a35),
    minorLine: hex(0x2b3543),
    majorLine: hex(0x455266),
    shadow: 0.72,
    contact: 0.62,
    sky: hex(0xdfe9f7),
    bounce: hex(0x39424f),
    hemisphere: 1.15,
    key: 2.1,
    fill: 0.55,
    exposure: 1,
  },
  light: {
    ...ofSigns(OVERLAY_COLORS.light),
    page: hex(0xf7f8fa),
    floor: hex(0xffffff),
    minorLine: hex(0xe3e7ed),
    majorLine: hex(0xc3cad4),
    shadow: 0.3,
    contact: 0.34,
    sky: hex(0xffffff),
    bounce: hex(0xc9ced6),
    hemisphere: 1.35,
    key: 1.9,
    fill: 0.5,
    exposure: 1,
  },
};
