/** Events that come later than this count as too late. */
const LATE_MS = 2000;
const TIMES = 2;
/** Time between two looks at the lateness. */
const LOOK_MS = 1000;
/** A new connection is not judged for this long: its first messages, such as the schema, are large and delay the rest.
 *  */
const SETTLING_MS = 8000;
const STEPS_HZ = [10, 5, 2, 1] as const;

/**
 * How late server-sent events arrive. They are not acknowledged, so on a slow network the buffers on the way fill with
 * old poses, and the stream would run seconds behind while looking live. Each event carries the time of its writing by
 * the relay's clock; its lateness (ms) is its delay beyond that of the quickest event of the connection.
 */
export class Lateness {
  #quickestMs = Number.POSITIVE_INFINITY;
  #sinceMs = 0;
  #lookedMs = 0;
  #times = 0;
  /** Lateness of the newest event, ms. */
  ms = 0;

  /** Starts anew with a new connection, on which no old poses can be on their way. */
  begin(nowMs: number): void {
    this.#quickestMs = Number.POSITIVE_INFINITY;
    this.#sinceMs = nowMs;
    this.#lookedMs = nowMs;
    this.#times = 0;
    this.ms = 0;
  }

  /** Measures an event that arrives at `nowMs` and was written at `writtenMs` of the relay's own clock. */
  stamped(nowMs: number, writtenMs: number): void {
    this.#quickestMs = Math.min(this.#quickestMs, nowMs - writtenMs);
    this.ms = nowMs - writtenMs - this.#quickestMs;
  }

  /** Whether the stream was too late at two looks in a row: then it should be asked for anew at a lower rate. */
  tooLate(nowMs: number): boolean {
    if (nowMs - this.#sinceMs < SETTLING_MS || nowMs - this.#lookedMs < LOOK_MS) return false;
    this.#lookedMs = nowMs;
    this.#times = this.ms > LATE_MS ? this.#times + 1 : 0;
    return this.#times >= TIMES;
  }
}

/**
 * A silence long enough that the page called its pose old, or during which this thread itself slept; or the moment in
 * which the page called its pose old for another reason. The first data after it were delayed by an unknown time, so
 * they count as old as its start, until something shows that the backlog has been read.
 */
export class Silence {
  #sinceMs: number | null = null;

  /** A silence began at `sinceMs`. If the backlog of an earlier one is not yet read, that one's start stays. */
  begin(sinceMs: number): void {
    this.#sinceMs ??= sinceMs;
  }

  /** The backlog has been read: data arrive without delay again. */
  end(): void {
    this.#sinceMs = null;
  }

  /** Ends the silence if data were written (`writtenMs`, our clock) after the page called its pose old. */
  endIfWrittenAfter(writtenMs: number, oldAfterMs: number): void {
    if (this.#sinceMs !== null && writtenMs > this.#sinceMs + oldAfterMs) this.#sinceMs = null;
  }

  /** For how many ms data that arrive now may have been delayed; 0 when there was no silence. */
  ageMs(nowMs: number): number {
    return this.#sinceMs === null ? 0 : Math.max(0, nowMs - this.#sinceMs);
  }
}

/** The next lower rate of 10, 5, 2 and 1 Hz; a rate of 1 Hz or less stays. */
export function lowerHz(hz: number): number {
  return STEPS_HZ.find((step) => step < hz) ?? Math.min(hz, 1);
}
