import { remember } from '../../kit.ts';

/** How much faster or slower than real time the lane plays while its delay changes: too little to notice. */
const GENTLE = 0.08;
/** How early a part should arrive before it is played. */
const MARGIN_MS = 80;
/** If a part is later than this, the lane does not wait again: the playhead jumps to where it should be. */
const STALL_MS = 1000;
/** After this many such parts in a row, the delay counts as normal. */
const STALLS_MAX = 4;
/** The number of parts used to estimate the delay. */
const REMEMBERED = 10;
/** From this many parts on, outliers don't count: parts that were late by chance, or longer, as after a pause. */
const ENOUGH = 5;
const LATE_ONES = 1;
const LONG_ONES = 2;
/** While the clock is new, and after stalls, the playhead may jump ahead if it is off by more than this; otherwise it adjusts
 *  gradually. */
const JUMP_MS = 700;
const NEW_PARTS = 3;
/** How much earlier or later a part of a new take may arrive than previous ones if it uses the same clock. */
const SAME_MS = 2000;
/** The relay reports its time in whole seconds. */
const WHOLE_SECOND_MS = 1000;
/** A larger reported age is not believed. */
const AGO_MS_MAX = 600_000;

/** A received part: its times by the relay's clock, unix ms, and its arrival by ours. */
export interface Arrival {
  readonly fromMs: number;
  readonly toMs: number;
  readonly atMs: number;
  /** The relay held the request for it, so it was sent as soon as it existed. */
  readonly wasHeld: boolean;
  readonly isNewTake: boolean;
  /** Its age at its arrival, to about a second; null: unknown. Used until the position is found. */
  readonly agoMs: number | null;
  /** The robot's state at its end is not `online`, so no data has come since. */
  readonly isOver: boolean;
}

/**
 * Decides when recorded data is shown: just late enough that the next part arrives before the last one has been shown. `shiftMs`
 * is our clock's time at the moment of display, minus the relay's clock at the shown moment. The two clocks are not compared in
 * any other way, because ours may be wrong by hours.
 *
 * The age of the first part is often unknown; it is then played from its start. With each further part that already existed, the
 * playhead jumps forward. The first part for which the relay held the request reveals the right position. From then on the
 * playhead only runs a little faster or slower, and waits if a part is late.
 */
export class PlayClock {
  /** NaN before the first part. */
  shiftMs = Number.NaN;
  /** Whether the position of the playhead is known exactly, not just a bound for it. */
  isFound = false;
  /** For the last parts: arrival minus end, and length. Newest last. */
  #closesMs: number[] = [];
  #spansMs: number[] = [];
  #atMs = 0;
  #stalls = 0;
  /** The age of the newest part at its arrival, to half a second, until the position is found; null: unknown. */
  #agoMs: number | null = null;
  /** How many more parts the clock counts as new. */
  #newParts = 0;

  /** Records a part. Returns whether the clock has restarted, so that it does not apply to earlier parts. */
  arrive(part: Arrival): boolean {
    const { fromMs, toMs, atMs } = part;
    const [spanMs, closeMs] = [toMs - fromMs, atMs - toMs];
    this.slew(atMs);
    const isFirst = Number.isNaN(this.shiftMs);
    const isAnew = isFirst || (part.isNewTake && Math.abs(closeMs - this.closeMs) > SAME_MS);
    if (isAnew) {
      this.#closesMs = [];
      this.isFound = false;
      this.#newParts = NEW_PARTS;
      this.#atMs = atMs;
      this.shiftMs = firstShiftMs(part);
      const agoMs = (part.agoMs ?? Number.NaN) + WHOLE_SECOND_MS / 2;
      this.#agoMs = Math.abs(agoMs) <= WHOLE_SECOND_MS / 2 || isLikely(part) ? Math.max(0, agoMs) : null;
      this.#remember(spanMs, closeMs);
    } else if (!this.isFound) {
      const soonestMs = Math.min(closeMs, this.closeMs);
      this.#closesMs = []; // earlier parts say nothing about it
      this.#remember(spanMs, soonestMs);
      // it may be long if others already existed
      const agoMs = (part.agoMs ?? Number.NaN) + WHOLE_SECOND_MS / 2;
      if (agoMs >= 0 && agoMs < AGO_MS_MAX) this.#agoMs = agoMs;
      const lagMs = spanMs + closeMs;
      if (part.isOver && !part.wasHeld) this.shiftMs = Math.min(this.shiftMs, firstShiftMs(part));
      else this.shiftMs = lagMs > this.shiftMs ? lagMs : Math.min(this.shiftMs, lagMs + MARGIN_MS);
    } else {
      if (part.isNewTake) {
        this.#closesMs = [];
        this.#newParts = NEW_PARTS;
      }
      this.#wait(part);
    }
    if (part.wasHeld) this.isFound = true;
    return isAnew;
  }

  /** Waits for a late part, if it is only a little late, or longer than the previous ones. */
  #wait({ fromMs, toMs, atMs, wasHeld }: Arrival): void {
    const [spanMs, closeMs] = [toMs - fromMs, atMs - toMs];
    const isFirstOfTake = this.#closesMs.length === 0;
    const lateMs = isFirstOfTake ? 0 : closeMs - this.closeMs;
    if (lateMs > STALL_MS && spanMs + closeMs <= this.shiftMs) {
      remember(this.#spansMs, spanMs, REMEMBERED); // it was requested late, because it is shorter than the previous ones
      return;
    }
    this.#stalls = lateMs > STALL_MS ? this.#stalls + 1 : 0;
    if (this.#stalls > 0) this.#newParts = NEW_PARTS;
    if (this.#stalls > STALLS_MAX) this.#closesMs = [];
    else if (this.#stalls > 0) {
      this.shiftMs = Math.max(this.shiftMs, spanMs + this.closeMs);
      return;
    }
    this.#remember(spanMs, closeMs);
    this.shiftMs = Math.max(this.shiftMs, spanMs + closeMs);
    if (this.#newParts === 0) return;
    if (wasHeld) this.#newParts--; // otherwise more parts exist already: its position is further ahead
    const wantedMs = Math.max(...this.#spansMs.slice(-NEW_PARTS)) + closeMs + MARGIN_MS;
    if (this.shiftMs <= wantedMs + JUMP_MS) return;
    this.shiftMs = wantedMs;
    this.#closesMs = [closeMs];
  }

  #remember(spanMs: number, closeMs: number): void {
    remember(this.#closesMs, closeMs, REMEMBERED);
    remember(this.#spansMs, spanMs, REMEMBERED);
  }

  /** Moves the delay towards its target, as far as is allowed by now. */
  slew(nowMs: number): void {
    const mostMs = GENTLE * Math.max(0, nowMs - this.#atMs);
    this.#atMs = nowMs;
    if (!this.isFound || this.#closesMs.length === 0) return;
    const offMs = this.#wantedMs - this.shiftMs;
    this.shiftMs += Math.max(-mostMs, Math.min(mostMs, offMs));
  }

  /** A lower bound for our clock at a part's arrival minus the relay's clock at its end. */
  get closeMs(): number {
    return Math.min(...this.#closesMs);
  }

  /** The expected length of the next part, ms: the shortest of the last ones, so that it is not requested too late. */
  get spanMs(): number {
    return Math.min(...this.#spansMs.slice(-3));
  }

  /** The delay of the picture relative to the relay. While unknown, it is estimated from the relay's time in its first answer,
   *  which has whole seconds, or from an upper bound. `wayMs`: the transit time of an answer. */
  behindMs(wayMs: number): number {
    const knownMs = this.shiftMs - this.closeMs + wayMs;
    if (this.isFound) return knownMs;
    return knownMs + (this.#agoMs ?? Math.max(...this.#spansMs));
  }

  /** Just late enough that the next part arrives in time if it is as long as the others, and no later than almost all of them
   *  need. */
  get #wantedMs(): number {
    return nthMost(this.#spansMs, LONG_ONES) + nthMost(this.#closesMs, LATE_ONES) + MARGIN_MS;
  }
}

/** The greatest value without the `out` greatest; for few values, the greatest. */
function nthMost(values: readonly number[], out: number): number {
  const sorted = [...values].sort((a, b) => b - a);
  return sorted[sorted.length < ENOUGH ? 0 : out] ?? 0;
}

/** Where the first part starts: at its beginning, or nearer to its end if the next one is expected sooner. If the robot has left,
 *  its last state is shown. */
function firstShiftMs(part: Arrival): number {
  const { fromMs, toMs, atMs, agoMs, isOver } = part;
  if (isOver) return atMs - toMs - Math.max(0, agoMs ?? 0);
  return atMs - fromMs - (isLikely(part) ? Math.max(0, Math.min(toMs - fromMs, agoMs! - MARGIN_MS)) : 0);
}

/** Whether the newest part can have ended that long ago. */
function isLikely({ fromMs, toMs, agoMs }: Arrival): boolean {
  return agoMs !== null && agoMs >= 0 && agoMs < 2 * (toMs - fromMs) + SAME_MS;
}
