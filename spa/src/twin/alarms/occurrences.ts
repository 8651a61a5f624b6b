import { dropOldest, remember } from '../../kit.ts';

/** How long an occurrence counts, ms. */
export const WINDOW_MS = 600_000;
/** Maximum occurrences kept for one fault; beyond that the count is "over" this number. */
export const TIMES_LIMIT = 30;
/** Maximum number of faults kept; the one with the oldest latest start is dropped. */
const KEPT_LIMIT = 500;
/** A frame and an event within this time of each other report the same occurrence. */
const SAME_MS = 1000;

interface Kept {
  /** Unix ms of the newest starts, newest last. */
  readonly risesMs: number[];
  /** For the newest one: when this page learned of it, and from which source. */
  toldMs: number;
  byEvent: boolean;
  /** The newest event's time: the relay repeats its events at every join. */
  eventMs: number;
}

/** Counts how often each fault has occurred recently. All times are passed in, Unix ms. */
export class Occurrences {
  /** The most that `times` returns. */
  readonly most = TIMES_LIMIT;
  readonly #kept = new Map<string, Kept>();

  /** Records that, according to an event, `key` started at `atMs` (relay's clock). `nowMs`: the page's clock. */
  addEvent(key: string, atMs: number, nowMs: number): void {
    const kept = this.#of(key);
    if (atMs <= kept.eventMs) {
      // a repeated or late event
      const i = kept.risesMs.findIndex((ms) => ms >= atMs);
      if (kept.risesMs[i] !== atMs && kept.risesMs.length < TIMES_LIMIT) kept.risesMs.splice(i, 0, atMs);
      return;
    }
    kept.eventMs = atMs;
    // The frame arrived before its event, whose time is more accurate.
    if (!kept.byEvent && nowMs - kept.toldMs < SAME_MS) kept.risesMs.pop();
    this.#add(key, kept, atMs, nowMs, true);
  }

  /** Records that `key` is in a frame and was not in the previous one. */
  addFrame(key: string, atMs: number, nowMs: number): void {
    const kept = this.#of(key);
    if (kept.byEvent && nowMs - kept.toldMs < SAME_MS) return;
    this.#add(key, kept, atMs, nowMs, false);
  }

  /** When `key` last started, Unix ms; null if unknown. */
  newestMs(key: string): number | null {
    return this.#kept.get(key)?.risesMs.at(-1) ?? null;
  }

  /** How often `key` started within the last ten minutes, at most `TIMES_LIMIT`. */
  times(key: string, nowMs: number): number {
    return this.#kept.get(key)?.risesMs.filter((atMs) => nowMs - atMs < WINDOW_MS).length ?? 0;
  }

  #of(key: string): Kept {
    return (
      this.#kept.get(key) ?? {
        risesMs: [],
        toldMs: Number.NEGATIVE_INFINITY,
        byEvent: false,
        eventMs: Number.NEGATIVE_INFINITY,
      }
    );
  }

  #add(key: string, kept: Kept, atMs: number, nowMs: number, byEvent: boolean): void {
    remember(kept.risesMs, atMs, TIMES_LIMIT);
    kept.toldMs = nowMs;
    kept.byEvent = byEvent;
    this.#kept.delete(key); // re-inserted, so that the newest is last
    this.#kept.set(key, kept);
    dropOldest(this.#kept, KEPT_LIMIT);
  }
}
