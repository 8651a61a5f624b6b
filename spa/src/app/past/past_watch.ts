import { isOld, type Verdict } from '../../twin/liveness.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import type { Watch } from '../state/liveness_watch.ts';

/** No segment is longer, and the first pose of one stands for all of it at first. */
const NEAR_MS = 7000;
const WAS = { online: null, silent: 'STALE', offline: 'OFFLINE' } as const;
type ThenWord = keyof typeof WAS;

/** Says PAST, and what the robot was then. */
export class PastWatch implements Watch {
  readonly word = 'PAST';
  readonly #twin: RobotTwin;
  readonly #momentMs: () => number;
  readonly #nowMs: () => number;
  readonly #listeners = new Set<() => void>();
  #was: (typeof WAS)[ThenWord] = null;
  #isOld = true; // nothing is here yet
  /** How far the page's clock is ahead of the relay's, as far as is known. */
  #aheadMs = Number.POSITIVE_INFINITY;

  constructor(twin: RobotTwin, momentMs: () => number, nowMs: () => number) {
    this.#twin = twin;
    this.#momentMs = momentMs;
    this.#nowMs = nowMs;
  }

  /** Takes the newest moment that is recorded. */
  newest(momentMs: number | null): void {
    if (momentMs !== null) this.#aheadMs = Math.min(this.#aheadMs, this.#nowMs() - momentMs);
  }

  was(word: ThenWord): void {
    this.#was = WAS[word];
    this.look();
  }

  /** Tells whoever listens if the shown pose has become old, or is no longer. */
  look(): void {
    const isOldNow = isOld(this.verdict());
    if (isOldNow === this.#isOld) return;
    this.#isOld = isOldNow;
    for (const listener of this.#listeners) listener();
  }

  readonly onWord = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  verdict(): Verdict {
    const momentMs = this.#momentMs();
    const { state } = this.#twin;
    const isHere = state !== null && (this.#was !== null || Math.abs(state.atMs - momentMs) < NEAR_MS);
    const aheadMs = Number.isFinite(this.#aheadMs) ? this.#aheadMs : 0;
    return {
      word: 'PAST',
      cause: null,
      overShare: false,
      ageMs: Math.max(0, this.#nowMs() - aheadMs - momentMs),
      linkMs: null,
      unchangedMs: null,
      past: { momentMs, was: this.#was, isHere },
    };
  }
}
