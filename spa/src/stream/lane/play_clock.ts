/** How much faster or slower than the robot the lane plays while its delay changes: nobody sees it. */
const GENTLE = 0.08;
/** By so much a part should come before its time. */
const MARGIN_MS = 80;
/** A part that is later than this is not waited for again: the playhead jumps to where it should be. */
const STALL_MS = 1000;
/** After so many such parts in a row that is how they come. */
const STALLS_MAX = 4;
/** Parts that the delay is judged by. */
const REMEMBERED = 10;
/** Of so many or more, some don't count: those that were late by chance, or longer, as one after a pause is. */
const ENOUGH = 5;
const LATE_ONES = 1;
const LONG_ONES = 2;
/** While the clock is new, and after stalls, the playhead may jump ahead by more than this; else it goes gently. */
const JUMP_MS = 700;
const NEW_PARTS = 3;
/** By so much a part of a new take may come sooner or later than others did, if it is told by the same clock. */
const SAME_MS = 2000;
/** The relay tells its time without fractions. */
const WHOLE_SECOND_MS = 1000;
/** What is said to have ended longer ago is not believed. */
const AGO_MS_MAX = 600_000;

/** A part as it came: its times by the relay's clock, unix ms, and its arrival by ours. */
export interface Arrival {
  readonly fromMs: number;
  readonly toMs: number;
  readonly atMs: number;
  /** The relay held the request for it, so it was sent as soon as it was there. */
  readonly wasHeld: boolean;
  readonly isNewTake: boolean;
  /** How long before its arrival it ended, to a second or so; null: nobody knows. Looked at until the place is found. */
  readonly agoMs: number | null;
  /** What the robot was at its end is not `online`, so nothing has come since. */
  readonly isOver: boolean;
}

/**
 * When what a relay recorded is shown: so late that the next part is there before the last one has been shown, and no later.
 * `shiftMs` is what our clock says then less what the relay's clock said at the moment that is shown. The two clocks are never
 * compared otherwise: ours may be wrong by hours.
 *
 * The first part came some time after it was closed. Unless somebody says how long, it is played from its beginning; with
 * each one that was there already the playhead jumps on, and the first one for which the relay held the request tells where it
 * should be. From then on it only runs a little faster or slower, and waits where a part is late.
 */
export class PlayClock {
  /** NaN before the first part. */
  shiftMs = Number.NaN;
  /** Whether the place of the playhead is known, and not only a bound for it. */
  isFound = false;
  /** Of the last parts: the arrival less the end, and how long each is. Newest last. */
  #closesMs: number[] = [];
  #spansMs: number[] = [];
  #atMs = 0;
  #stalls = 0;
  /** How long before its arrival the newest part ended, until the place is found, to half a second; null: not known. */
  #agoMs: number | null = null;
  /** So many parts more come while the clock is new. */
  #newParts = 0;

  /** Takes note of a part. Returns whether the clock has begun anew, so that it does not hold for parts of before. */
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
      this.#closesMs = []; // what came before says nothing
      this.#remember(spanMs, soonestMs);
      // where others were there already it may be long
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

  /** Waits for a part that is late, if it is by little, or longer than those before. */
  #wait({ fromMs, toMs, atMs, wasHeld }: Arrival): void {
    const [spanMs, closeMs] = [toMs - fromMs, atMs - toMs];
    const isFirstOfTake = this.#closesMs.length === 0;
    const lateMs = isFirstOfTake ? 0 : closeMs - this.closeMs;
    if (lateMs > STALL_MS && spanMs + closeMs <= this.shiftMs) {
      remember(this.#spansMs, spanMs); // it was asked for late, since it is shorter than those before
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
    if (wasHeld) this.#newParts--; // else there are more already: its place is further ahead
    const wantedMs = Math.max(...this.#spansMs.slice(-NEW_PARTS)) + closeMs + MARGIN_MS;
    if (this.shiftMs <= wantedMs + JUMP_MS) return;
    this.shiftMs = wantedMs;
    this.#closesMs = [closeMs];
  }

  #remember(spanMs: number, closeMs: number): void {
    remember(this.#closesMs, closeMs);
    remember(this.#spansMs, spanMs);
  }

  /** Brings the delay nearer to what it should be, as much as that may be by now. */
  slew(nowMs: number): void {
    const mostMs = GENTLE * Math.max(0, nowMs - this.#atMs);
    this.#atMs = nowMs;
    if (!this.isFound || this.#closesMs.length === 0) return;
    const offMs = this.#wantedMs - this.shiftMs;
    this.shiftMs += Math.max(-mostMs, Math.min(mostMs, offMs));
  }

  /** What our clock says when a part arrives, less what the relay's said at its end, at the least. */
  get closeMs(): number {
    return Math.min(...this.#closesMs);
  }

  /** How long the next part is expected to be, ms; the shortest of the last ones, so that it is not asked for too late. */
  get spanMs(): number {
    return Math.min(...this.#spansMs.slice(-3));
  }

  /** How far what is shown lies behind the relay. While that is not known: by the relay's own time of its first answer, which
   *  is told in whole seconds, or at most. `wayMs`: how long an answer is on its way. */
  behindMs(wayMs: number): number {
    const knownMs = this.shiftMs - this.closeMs + wayMs;
    if (this.isFound) return knownMs;
    return knownMs + (this.#agoMs ?? Math.max(...this.#spansMs));
  }

  /** So late that the next part comes in time if it is as long as others, and not later than almost all of them. */
  get #wantedMs(): number {
    return nthMost(this.#spansMs, LONG_ONES) + nthMost(this.#closesMs, LATE_ONES) + MARGIN_MS;
  }
}

/** The greatest value but for `out` of them; of few values the greatest. */
function nthMost(values: readonly number[], out: number): number {
  const sorted = [...values].sort((a, b) => b - a);
  return sorted[sorted.length < ENOUGH ? 0 : out] ?? 0;
}

/** Where the first part is begun: at its beginning, or nearer to its end where the next one is expected sooner. A robot that has
 *  gone since is shown as it was at last. */
function firstShiftMs(part: Arrival): number {
  const { fromMs, toMs, atMs, agoMs, isOver } = part;
  if (isOver) return atMs - toMs - Math.max(0, agoMs ?? 0);
  return atMs - fromMs - (isLikely(part) ? Math.max(0, Math.min(toMs - fromMs, agoMs! - MARGIN_MS)) : 0);
}

/** Whether the newest part can have ended so long ago. */
function isLikely({ fromMs, toMs, agoMs }: Arrival): boolean {
  return agoMs !== null && agoMs >= 0 && agoMs < 2 * (toMs - fromMs) + SAME_MS;
}

function remember(list: number[], value: number): void {
  list.push(value);
  if (list.length > REMEMBERED) list.shift();
}
