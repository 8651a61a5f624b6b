import { type Level, level, type Threshold } from '@posecast/wire';

/** As a fraction of the limit: how far inside it a value must be before the level falls. The edge uses the same for its
 *  events.
 */
const HYSTERESIS = 0.05;

const RANK: Readonly<Record<Level, number>> = { ok: 0, caution: 1, fault: 2 };

export function worseOf(a: Level, b: Level): Level {
  return RANK[a] >= RANK[b] ? a : b;
}

/** The level of one channel, with hysteresis against flicker: it rises at once and falls only when the value is well
 *  back. */
export class LevelLatch {
  #held: Level = 'ok';
  #threshold: Threshold | null = null;

  /** The level of the newest value; no limits and no reading are `ok`. */
  next(threshold: Threshold | null, value: number | null): Level {
    if (threshold !== this.#threshold) this.#held = 'ok'; // the held level belongs to the previous limit
    this.#threshold = threshold;
    if (threshold === null || value === null || Number.isNaN(value)) {
      this.#held = 'ok';
      return 'ok';
    }
    const now = level(threshold, value);
    if (RANK[now] >= RANK[this.#held]) this.#held = now;
    else {
      const lingering = levelFurtherOut(threshold, value);
      if (RANK[lingering] < RANK[this.#held]) this.#held = lingering;
    }
    return this.#held;
  }
}

/** The worse of the levels that the value would have if it were a margin higher (against `high`) or lower (against
 *  `low`). */
function levelFurtherOut({ low, high, caution }: Threshold, value: number): Level {
  const above = level({ low: null, high, caution }, value + HYSTERESIS * Math.abs(high ?? 0));
  const below = level({ low, high: null, caution }, value - HYSTERESIS * Math.abs(low ?? 0));
  return worseOf(above, below);
}
