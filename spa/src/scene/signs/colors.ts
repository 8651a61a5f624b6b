import type { Level } from '@posecast/wire';
import type { LinkTint } from '../../model/posed_body.ts';

/** `safe` is for people with red-green colour blindness (colours by Okabe and Ito). */
export type PaletteName = 'standard' | 'safe';

/** The colours of the overlay, sRGB 0xrrggbb. They repeat the page's CSS colours, because a canvas can't inherit CSS.
 *  */
export interface OverlayColors {
  /** Levels: ok (`live`), caution, fault. */
  readonly live: number;
  readonly caution: number;
  readonly fault: number;
  /** The levels for colour-blind viewers. */
  readonly safe: Readonly<Record<Level, number>>;
  /** The horizontal plane and the plumb line. */
  readonly level: number;
  /** Neutral information. */
  readonly muted: number;
  /** Out-of-date readings. */
  readonly stale: number;
  /** Selection, highlight and the ghost. */
  readonly accent: number;
  /** Contrast as strong as text. */
  readonly ink: number;
}

export const OVERLAY_COLORS: Readonly<Record<'dark' | 'light', OverlayColors>> = {
  dark: {
    live: 0x2fbf71,
    caution: 0xf5b83d,
    fault: 0xff5d5d,
    safe: { ok: 0x009e73, caution: 0xf0e442, fault: 0xd55e00 },
    level: 0x7fb7c9,
    muted: 0x9aa6b6,
    stale: 0x98a2b3,
    accent: 0x5aa9ff,
    ink: 0xe6eaf0,
  },
  light: {
    live: 0x15803d,
    caution: 0xd97706,
    fault: 0xc81e1e,
    safe: { ok: 0x009e73, caution: 0xe69f00, fault: 0xd55e00 }, // yellow on white is hard to see
    level: 0x2f7f99,
    muted: 0x5b6675,
    stale: 0xb4bcc8,
    accent: 0x1d6fd1,
    ink: 0x101828,
  },
};

/** The colour of a level; the stale colour when `live` is false. */
export function levelColor(tones: OverlayColors, palette: PaletteName, level: Level, live: boolean): number {
  if (!live) return tones.stale;
  if (palette === 'safe') return tones.safe[level];
  return { ok: tones.live, caution: tones.caution, fault: tones.fault }[level];
}

/** The tint of a link whose joint has no reading: grey and hatched, like everything out of date. */
export const UNREAD: LinkTint = { color: 0x8f99a8, hatched: true };
