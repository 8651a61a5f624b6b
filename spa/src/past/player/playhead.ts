import type { Speed } from '../past_types.ts';

/** Most that the page's clock counts between two looks, ms: a page that was hidden or busy goes on where it was. */
export const LOOK_MS_MAX = 1000;

/** Which moment of the past is shown, as the page's clock goes on. Pure: that clock is passed in. */
export class PlayheadClock {
  #momentMs = 0;
  #lookedMs = 0;
  speed: Speed = 1;
  /** Only while it runs does the moment move. */
  running = false;

  get momentMs(): number {
    return this.#momentMs;
  }

  /** Where the playhead comes to by now, if nothing holds it. */
  target(nowMs: number): number {
    if (!this.running) return this.#momentMs;
    return this.#momentMs + Math.min(LOOK_MS_MAX, Math.max(0, nowMs - this.#lookedMs)) * this.speed;
  }

  /** Goes on from where it is. */
  run(nowMs: number): void {
    this.running = true;
    this.#lookedMs = nowMs;
  }

  /** Puts the playhead at a moment; it goes on from there. */
  set(momentMs: number, nowMs: number): void {
    this.#momentMs = momentMs;
    this.#lookedMs = nowMs;
  }
}
