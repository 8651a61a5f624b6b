import { Color } from 'three';

export type ThemeName = 'dark' | 'light';

/** The colours of the scene. The page's own tokens (ground, muted, caution, stale) are repeated here because a
 *  canvas can't inherit CSS; the rest are the scene's. */
export interface SceneTheme {
  /** The page's ground: what the scene fades to. */
  page: Color;
  /** The floor where light falls on it, just under the robot. */
  floor: Color;
  minorLine: Color;
  majorLine: Color;
  /** How dark a full shadow is, 0…1. */
  shadow: number;
  caution: Color;
  /** Selection and highlight. */
  accent: Color;
  /** Lines of the skeleton. */
  muted: Color;
  /** What an old robot's colours drain towards. */
  stale: Color;
  sky: Color;
  bounce: Color;
  hemisphere: number;
  key: number;
  fill: number;
  exposure: number;
}

const hex = (value: number) => new Color(value);

export const THEMES: Readonly<Record<ThemeName, SceneTheme>> = {
  dark: {
    page: hex(0x0e1116),
    floor: hex(0x222a35),
    minorLine: hex(0x2b3543),
    majorLine: hex(0x455266),
    shadow: 0.72,
    caution: hex(0xf5b83d),
    accent: hex(0x5aa9ff),
    muted: hex(0x9aa6b6),
    stale: hex(0x98a2b3),
    sky: hex(0xdfe9f7),
    bounce: hex(0x39424f),
    hemisphere: 1.15,
    key: 2.1,
    fill: 0.55,
    exposure: 1,
  },
  light: {
    page: hex(0xf7f8fa),
    floor: hex(0xffffff),
    minorLine: hex(0xe3e7ed),
    majorLine: hex(0xc3cad4),
    shadow: 0.3,
    caution: hex(0xb45309),
    accent: hex(0x1d6fd1),
    muted: hex(0x5b6675),
    stale: hex(0xb4bcc8),
    sky: hex(0xffffff),
    bounce: hex(0xc9ced6),
    hemisphere: 1.35,
    key: 1.9,
    fill: 0.5,
    exposure: 1,
  },
};
