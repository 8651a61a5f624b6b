/** Events later than this count as too late. */
const LATE_MS = 2000;
const TIMES = 2;
/** Time between two checks of the lateness. */
const LOOK_MS = 1000;
/** A new connection is not judged for this long: its first messages, such as the schema, are large and delay the rest.
 *  */
const SETTLING_MS = 8000;
const STEPS_HZ = [10, 5, 2, 1] as const;

/**
 * How late server-sent events arrive. They are not acknowledged, so on a slow network the buffers in between fill with old poses,
 * and the stream would run seconds behind while looking live. Each event carries its write time by the relay's clock; its
 * lateness (ms) is its delay compared with the fastest event of the connection.
 */
export class Lateness {
  #quickestMs = Number.POSITIVE_INFINITY;
  #sinceMs = 0;
  #lookedMs = 0;
  #times = 0;
  /** Lateness of the newest event, ms. */
  ms = 0;

  /** Restarts with a new connection, which has no old poses in transit. */
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

  /** Whether the stream was too late at two consecutive checks; if so, it should be requested again at a lower rate. */
  tooLate(nowMs: number): boolean {
    if (nowMs - this.#sinceMs < SETTLING_MS || nowMs - this.#lookedMs < LOOK_MS) return false;
    this.#lookedMs = nowMs;
    this.#times = this.ms > LATE_MS ? this.#times + 1 : 0;
    return this.#times >= TIMES;
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
