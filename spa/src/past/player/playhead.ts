import type { Speed } from '../past_types.ts';

/** The longest step that the page's clock counts between two ticks, ms: a page that was hidden or busy continues from where it
 *  was. */
export const LOOK_MS_MAX = 1000;

/** The shown moment of the past, as the page's clock advances. Pure: the clock is passed in. */
export class PlayheadClock {
  #momentMs = 0;
  #lookedMs = 0;
  speed: Speed = 1;
  /** The moment moves only while it runs. */
  running = false;

  get momentMs(): number {
    return this.#momentMs;
  }

  /** Where the playhead is by now if nothing stops it. */
  target(nowMs: number): number {
    if (!this.running) return this.#momentMs;
    return this.#momentMs + Math.min(LOOK_MS_MAX, Math.max(0, nowMs - this.#lookedMs)) * this.speed;
  }

  /** Continues from its position. */
  run(nowMs: number): void {
    this.running = true;
    this.#lookedMs = nowMs;
  }

  /** Moves the playhead to a moment, where it continues. */
  set(momentMs: number, nowMs: number): void {
    this.#momentMs = momentMs;
    this.#lookedMs = nowMs;
  }
}
