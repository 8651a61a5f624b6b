import type { LaneAnswer } from './answers.ts';
import { MissedEvents, type Missing } from './missed_events.ts';

/** Newer events wait this long for missing earlier ones; those found later are still reported. */
const HOLD_MS = 5000;
/** The minimum interval between searches for missed events. */
const LOOK_EVERY_MS = 10_000;
/** If an index has not arrived by then, it is requested again. */
const ANSWER_MS = 30_000;
/** After a failure, the next request follows after at most this × 2^failures, and at least half of that. */
const RETRY_MS = 2000;
const RETRY_MS_MAX = 60_000;
/** About five minutes. */
const FAILURES_MAX = 9;

/** Decides when to request the index after events were missed, and repeats until it arrives, for some minutes at most. Pure;
 *  times are ms of the viewer's clock. */
export class LookBack {
  readonly #random: () => number;
  #missed: MissedEvents | null = null;
  /** When to send the next request, or to stop waiting. */
  #dueMs = Number.POSITIVE_INFINITY;
  #isAsked = false;
  #failures = 0;
  #beganMs = Number.NEGATIVE_INFINITY;
  /** Until when newer events wait. */
  heldMs = Number.POSITIVE_INFINITY;

  constructor(random: () => number) {
    this.#random = random;
  }

  get nextMs(): number {
    return Math.min(this.#dueMs, this.heldMs);
  }

  /** Events are missing, in addition to earlier ones not found yet. Returns whether newer events must wait: not if the page knows
   *  of no fault that could have ended meanwhile. */
  begin(missing: Missing, nowMs: number): boolean {
    const toldN = Math.min(missing.toldN, this.#missed?.toldN ?? missing.toldN);
    this.#missed = new MissedEvents({ ...missing, toldN });
    this.#beganMs = Math.max(nowMs, this.#beganMs + LOOK_EVERY_MS);
    this.resume(this.#beganMs);
    const holds = this.#beganMs === nowMs && missing.toldN > 0;
    if (holds) this.heldMs = nowMs + HOLD_MS;
    return holds;
  }

  /** Continues the search of an earlier lane. */
  resume(atMs: number): void {
    this.#failures = 0;
    this.#isAsked = false;
    this.heldMs = Number.POSITIVE_INFINITY;
    this.#dueMs = this.#missed === null ? Number.POSITIVE_INFINITY : atMs;
  }

  /** What to request now; null: nothing. */
  ask(nowMs: number): string | null {
    if (nowMs < this.#dueMs) return null;
    if (this.#isAsked) this.#fail(nowMs, 0);
    if (nowMs < this.#dueMs) return null;
    this.#isAsked = true;
    this.#dueMs = nowMs + ANSWER_MS;
    return this.#missed!.page;
  }

  /** Takes the answer; null: none. Returns the events found so far; null: nothing new. */
  take(nowMs: number, answer: LaneAnswer | null): MissedEvents | null {
    const missed = this.#missed;
    if (!this.#isAsked || missed === null) return null;
    if (answer === null || answer.status === 429 || answer.status >= 500) {
      this.#fail(nowMs, answer?.retryMs ?? 0);
      return null;
    }
    this.#isAsked = false;
    this.#failures = 0;
    missed.add(answer);
    const isAll = missed.page === null;
    this.#dueMs = isAll ? Number.POSITIVE_INFINITY : nowMs;
    if (isAll) this.#missed = null;
    return missed;
  }

  /** Newer events need not wait any longer. Returns what has been found for them. */
  letGo(): MissedEvents | null {
    this.heldMs = Number.POSITIVE_INFINITY;
    return this.#missed;
  }

  #fail(nowMs: number, retryMs: number): void {
    this.#isAsked = false;
    const mostMs = Math.min(RETRY_MS_MAX, RETRY_MS * 2 ** this.#failures);
    const waitMs = retryMs + mostMs * (0.5 + this.#random() / 2);
    this.#dueMs = ++this.#failures < FAILURES_MAX ? nowMs + waitMs : Number.POSITIVE_INFINITY;
  }
}
