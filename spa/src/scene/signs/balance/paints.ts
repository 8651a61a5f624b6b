import type { Level } from '@posecast/wire';
import type { BalanceStyle } from '../balance_drawing.ts';
import { levelColor } from '../colors.ts';
import type { Paint } from '../picture_numbers.ts';

/** The colours of the ball's quarters, in both themes: those of a crash-test dummy's markers. */
const WHITE = 0xf7f8fa;
const BLACK = 0x14181f;
/** The colours of an out-of-date ball; the stale tone of both themes contrasts with them. */
const OLD_BLACK = 0x545d6b;

/** The paints of the balance signs. All of them show through the robot. */
export interface BalancePaints {
  readonly white: Paint;
  readonly black: Paint;
  /** The signs of the mass: plumb line, capture point, trace. */
  readonly mass: Paint;
  /** The support polygon. */
  readonly support: Paint;
  /** The centres of pressure. */
  readonly pressure: Paint;
  /** A foot that begins to tip. */
  readonly tipping: Paint;
  /** The margin by level; `ok` is drawn like the support. */
  readonly margin: Paint;
}

export function paintsOf({ tones, palette, live }: BalanceStyle, level: Level): BalancePaints {
  const solid = (color: number): Paint => ({ color, through: true });
  const tone = (color: number): Paint => solid(live ? color : tones.stale);
  const of = (at: Level) => solid(levelColor(tones, palette, at, live));
  const support = tone(tones.level);
  return {
    white: solid(live ? WHITE : tones.stale),
    black: solid(live ? BLACK : OLD_BLACK),
    mass: tone(tones.ink),
    support,
    pressure: of('ok'),
    tipping: of('caution'),
    margin: level === 'ok' ? support : of(level),
  };
}

/** A paint at a fraction of its opacity. */
export function faint(paint: Paint, opacity: number): Paint {
  return { ...paint, opacity: (paint.opacity ?? 1) * opacity };
}
