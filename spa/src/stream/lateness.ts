/** Later than this a pose is not worth waiting for. */
const LATE_MS = 2000;
const TIMES = 2;
/** Between two looks that count. */
const LOOK_MS = 1000;
/** A connection that has just begun has its schema on the way, too. */
const SETTLING_MS = 8000;
const STEPS_HZ = [10, 5, 2, 1] as const;

/**
 * How late events are. Nobody acknowledges them, so what lies between fills its buffers with old poses, and the stream
 * would run on, seconds behind, looking live. Each event tells when the relay wrote it, by a clock of the relay's own:
 * how much later than the quickest one of its connection it came is its lateness.
 */
export class Lateness {
  #quickestMs = Number.POSITIVE_INFINITY;
  #sinceMs = 0;
  #lookedMs = 0;
  #times = 0;
  /** Of the newest event. */
  ms = 0;

  /** A new connection, which begins without old poses on their way. */
  begin(nowMs: number): void {
    this.#quickestMs = Number.POSITIVE_INFINITY;
    this.#sinceMs = nowMs;
    this.#lookedMs = nowMs;
    this.#times = 0;
    this.ms = 0;
  }

  /** @param writtenMs when the relay wrote what comes now, by its own clock */
  stamped(nowMs: number, writtenMs: number): void {
    this.#quickestMs = Math.min(this.#quickestMs, nowMs - writtenMs);
    this.ms = nowMs - writtenMs - this.#quickestMs;
  }

  /** Whether the stream has been late twice: then it is asked for anew, more seldom. */
  tooLate(nowMs: number): boolean {
    if (nowMs - this.#sinceMs < SETTLING_MS || nowMs - this.#lookedMs < LOOK_MS) return false;
    this.#lookedMs = nowMs;
    this.#times = this.ms > LATE_MS ? this.#times + 1 : 0;
    return this.#times >= TIMES;
  }
}

/**
 * A silence that the page had to call its pose old in, or that this thread itself slept through. What comes first after it has
 * been on its way, or lain here, nobody knows for how long: it counts as of before the silence until something shows that
 * the backlog has been read.
 */
export class Silence {
  #sinceMs: number | null = null;

  /** It was silent from `sinceMs` on; what is not yet behind us from an earlier silence goes on counting from there. */
  begin(sinceMs: number): void {
    this.#sinceMs ??= sinceMs;
  }

  /** What comes now comes at once. */
  end(): void {
    this.#sinceMs = null;
  }

  /** What comes was written at `writtenMs` of our own clock: after the page had called its pose old, it is no backlog. */
  endIfWrittenAfter(writtenMs: number, oldAfterMs: number): void {
    if (this.#sinceMs !== null && writtenMs > this.#sinceMs + oldAfterMs) this.#sinceMs = null;
  }

  /** For how many ms what comes now may have been on its way; 0 where there was no silence. */
  ageMs(nowMs: number): number {
    return this.#sinceMs === null ? 0 : Math.max(0, nowMs - this.#sinceMs);
  }
}

/** The next rate below; the lowest stays. */
export function lowerHz(hz: number): number {
  return STEPS_HZ.find((step) => step < hz) ?? Math.min(hz, 1);
}
