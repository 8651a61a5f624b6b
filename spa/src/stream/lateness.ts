/** Events later than this count as too late. */
const LATE_MS = 2000;
const TIMES = 2;
/** Time between two checks of the lateness. */
const LOOK_MS = 1000;
/** A new connection is not judged for this long: its first messages, such as the schema, are large and delay the rest.
 *  */
const SETTLING_MS = 8000;
const STEPS_HZ = [10, 5, 2, 1] as const;
/** Two clocks drift apart by less than this, ms in a ms. */
const DRIFT = 0.0002;
/** If bounds contradict each other by more than this, one of the clocks has stepped, or it is another relay's. */
const TOLERANCE_MS = 250;
/** A lateness of at most this much, measured less than this ago, is known well enough. */
const SURE_MS = 750;
const SURE_FOR_MS = 300_000;

/** The bounds of a delay in transit. What cannot be measured lies between them. */
export interface Delay {
  readonly leastMs: number;
  readonly mostMs: number;
}

/**
 * How late data arrives. The relay stamps it with its own clock. The offset of that clock from ours is unknown, but bounded:
 * nothing arrives before it was written, and no answer is written before its request was sent. The first bound gives the least
 * lateness, compared with the fastest data of the connection. The second gives the most: it includes the part of the fastest
 * round trip that cannot be told from the way there.
 *
 * Server-sent events are not acknowledged, so on a slow network the buffers in between fill with old poses, and the stream would
 * run seconds behind while looking live. A buffer that delays everything alike is seen only in the second bound.
 */
export class Lateness {
  /** Our clock minus the relay's, at most, ms: by the fastest data of this connection, and by the newest. */
  #offsetMostMs = Number.POSITIVE_INFINITY;
  #newestOffsetMs = Number.POSITIVE_INFINITY;
  /** Our clock minus the relay's, at least, and when that was measured. It is kept for the next connection. null: unknown. */
  #offsetLeast: { readonly ms: number; readonly atMs: number } | null = null;
  #askedMs = 0;
  #isStamped = false;
  #mostMs: number | null = null;
  #sinceMs = 0;
  #lookedMs = 0;
  #times = 0;
  /** Lateness of the newest data, at least, ms. */
  ms = 0;

  /** Restarts with a new connection, which has no old poses in transit. It was requested at `askedMs`. */
  begin(nowMs: number, askedMs = nowMs): void {
    this.#offsetMostMs = this.#newestOffsetMs = Number.POSITIVE_INFINITY;
    this.#askedMs = askedMs;
    this.#isStamped = false;
    this.#mostMs = null;
    this.#sinceMs = nowMs;
    this.#lookedMs = nowMs;
    this.#times = 0;
    this.ms = 0;
  }

  /** Measures data that arrives at `nowMs` and was written at `writtenMs` of the relay's own clock. */
  stamped(nowMs: number, writtenMs: number): void {
    this.#newestOffsetMs = nowMs - writtenMs;
    this.#offsetMostMs = Math.min(this.#offsetMostMs, this.#newestOffsetMs);
    this.ms = this.#newestOffsetMs - this.#offsetMostMs;
    if (this.#newestOffsetMs < this.#offsetLeastMs(nowMs) - TOLERANCE_MS) this.#offsetLeast = null;
    if (!this.#isStamped) this.answered(nowMs, this.#askedMs, writtenMs); // opening a connection is a request, too
    this.#isStamped = true;
    this.#bound(nowMs);
  }

  /** Takes the answer to a request sent at `askedMs`. It was written at `writtenMs` of the relay's clock; null if the relay does
   *  not say. An answer from another relay, to which a proxy may have passed the request, is ignored: by that relay's clock, the
   *  newest data would be from the future, or the answer is no news. */
  answered(nowMs: number, askedMs: number, writtenMs: number | null): void {
    if (writtenMs === null) {
      this.#mostMs = nowMs - askedMs;
      return;
    }
    const ms = askedMs - writtenMs;
    if (ms > this.#newestOffsetMs + TOLERANCE_MS || ms < this.#offsetLeastMs(nowMs)) return;
    this.#offsetLeast = { ms, atMs: nowMs };
    if (ms > this.#offsetMostMs + TOLERANCE_MS) this.#offsetMostMs = this.#newestOffsetMs; // a clock has stepped
    if (this.#isStamped) this.#bound(nowMs);
  }

  /** The lateness of the newest data, at most, ms; null if it is unknown. */
  get knownMs(): number | null {
    return this.#mostMs;
  }

  /** The same for data that arrives now. While it is unknown, the data may be as old as the connection. */
  mostMs(nowMs: number): number {
    return this.#mostMs ?? nowMs - this.#askedMs;
  }

  /** Whether another question for the relay's clock would hardly change how old the data seems. */
  isSure(nowMs: number): boolean {
    const measuredMs = this.#offsetLeast?.atMs ?? Number.NEGATIVE_INFINITY;
    return this.mostMs(nowMs) <= SURE_MS && nowMs - measuredMs < SURE_FOR_MS;
  }

  /** Whether the stream was too late at two consecutive checks; if so, it should be requested again at a lower rate. */
  tooLate(nowMs: number): boolean {
    if (nowMs - this.#sinceMs < SETTLING_MS || nowMs - this.#lookedMs < LOOK_MS) return false;
    this.#lookedMs = nowMs;
    this.#times = this.ms > LATE_MS ? this.#times + 1 : 0;
    return this.#times >= TIMES;
  }

  #bound(nowMs: number): void {
    const leastMs = this.#offsetLeastMs(nowMs);
    this.#mostMs = Number.isFinite(leastMs) ? Math.max(0, this.#newestOffsetMs - leastMs) : null;
  }

  #offsetLeastMs(nowMs: number): number {
    if (this.#offsetLeast === null) return Number.NEGATIVE_INFINITY;
    const { ms, atMs } = this.#offsetLeast;
    return ms - DRIFT * (nowMs - atMs);
  }
}

/**
 * A silence long enough that the page called its pose old, or during which this thread itself slept; or the moment at which the
 * page called its pose old for another reason. The first data after it was delayed by an unknown time, so it counts as old as the
 * silence's start until it is clear that the backlog has been read.
 */
export class Silence {
  #sinceMs: number | null = null;

  /** A silence began at `sinceMs`. If the backlog of an earlier one has not been read yet, the earlier start stays. */
  begin(sinceMs: number): void {
    this.#sinceMs ??= sinceMs;
  }

  /** The backlog has been read: data arrives without delay again. */
  end(): void {
    this.#sinceMs = null;
  }

  /** Ends the silence if data was written (`writtenMs`, our clock) after the page called its pose old. */
  endIfWrittenAfter(writtenMs: number, oldAfterMs: number): void {
    if (this.#sinceMs !== null && writtenMs > this.#sinceMs + oldAfterMs) this.#sinceMs = null;
  }

  /** The possible delay of data that arrives now, ms; 0 if there was no silence. */
  ageMs(nowMs: number): number {
    return this.#sinceMs === null ? 0 : Math.max(0, nowMs - this.#sinceMs);
  }
}

/** The next lower rate of 10, 5, 2 and 1 Hz; a rate of 1 Hz or less stays. */
export function lowerHz(hz: number): number {
  return STEPS_HZ.find((step) => step < hz) ?? Math.min(hz, 1);
}
