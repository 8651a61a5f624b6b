import type { Retry, ViewerMessage } from '@posecast/wire';

const PING_EVERY_MS = 5000;

/** Measures the round trip of one connection to the relay, using pings. */
export class RoundTrip {
  /** null until known. */
  ms: number | null = null;
  #sentMs = Number.NEGATIVE_INFINITY;

  isDue(nowMs: number): boolean {
    return nowMs - this.#sentMs >= PING_EVERY_MS;
  }

  ping(nowMs: number): ViewerMessage {
    this.#sentMs = nowMs;
    return { type: 'ping', t: nowMs };
  }

  /** Takes the answer to a ping sent at `sentMs`. Returns whether it was the newest one. */
  pong(nowMs: number, sentMs: number): boolean {
    this.ms = Math.max(0, nowMs - sentMs);
    return sentMs >= this.#sentMs;
  }
}

/** Least time between two rate requests, so that a person flipping through tabs does not flood the relay. */
const RATE_EVERY_MS = 500;
/** The same for server-sent events, where every rate change needs a new connection. */
const REASK_EVERY_MS = 2000;

/** The frame rate that a viewer wants, and the one already requested. */
export class RateWish {
  /** While the page is visible and the network is fine. */
  readonly wantedHz: number;
  /** A hidden page requests no poses at all. */
  visible: boolean;
  /** Lowered rate for a slow network, only with server-sent events; null: the full rate. */
  slowHz: number | null = null;
  /** The rate requested on the newest connection; NaN: to be requested again. */
  askedHz: number;
  #askedMs = Number.NEGATIVE_INFINITY;

  constructor(wantedHz: number, visible: boolean) {
    this.wantedHz = wantedHz;
    this.visible = visible;
    this.askedHz = wantedHz;
  }

  get hz(): number {
    return this.visible ? (this.slowHz ?? this.wantedHz) : 0;
  }

  /** Whether to request a different rate now. */
  isDue(nowMs: number, onEvents: boolean): boolean {
    return this.hz !== this.askedHz && nowMs - this.#askedMs >= (onEvents ? REASK_EVERY_MS : RATE_EVERY_MS);
  }

  recordAsked(nowMs: number, hz: number): void {
    this.askedHz = hz;
    this.#askedMs = nowMs;
  }
}

const WINDOW_MS = 2000;
/** Frames that arrive within less than this are a burst, and their rate means nothing. */
const BURST_MS = 250;

/**
 * Measures the frame rate over the last two seconds. Frames may arrive in bursts, if a proxy holds them back or this thread was
 * late. So the rate counts from the arrival before those two seconds, however long ago. If the first frames came more closely
 * than they were awaited, it counts from the start.
 */
export class RateMeter {
  #startMs: number;
  /** Those of the last two seconds, and the one before. */
  #arrivals: number[] = [];

  /** `startMs`: since when frames are awaited, if that tells anything. */
  constructor(startMs = Number.POSITIVE_INFINITY) {
    this.#startMs = startMs;
  }

  /** Frames are awaited from now on. */
  restart(nowMs: number): void {
    this.#startMs = nowMs;
    this.#arrivals = [];
  }

  /** Counts a frame that has just arrived. */
  recordArrival(nowMs: number): void {
    this.#arrivals.push(nowMs);
  }

  /** Frames per second; 0 if fewer than two frames, or only a burst, are known. */
  hz(nowMs: number): number {
    const within = this.#arrivals.findIndex((atMs) => nowMs - atMs <= WINDOW_MS);
    if (within < 0) return 0;
    this.#arrivals.splice(0, within - 1);
    const [firstMs, lastMs] = [this.#arrivals[0]!, this.#arrivals.at(-1)!];
    const isBurst = within === 0 && lastMs - firstMs < firstMs - this.#startMs;
    const spanMs = lastMs - (isBurst ? this.#startMs : firstMs);
    const frames = this.#arrivals.length - (isBurst ? 0 : 1);
    return spanMs < BURST_MS ? 0 : (frames * 1000) / spanMs;
  }
}

/** Least time between two acknowledgements. */
const ACK_EVERY_MS = 1000;
/** With a longer round trip, the relay counts as far away: it would hold frames back while waiting for acknowledgements. */
const FAR_MS = 500;

/** Counts the binary messages of one connection and decides when to acknowledge them to the relay. */
export class Acknowledgements {
  #received = 0;
  #acknowledged = 0;
  #sentMs = Number.NEGATIVE_INFINITY;

  countMessage(): void {
    this.#received += 1;
  }

  /** The count to acknowledge now, at most once a second (twice with a long round trip); null: nothing is due. */
  takeDue(nowMs: number, roundTripMs: number | null): number | null {
    if (this.#received === this.#acknowledged) return null;
    const far = (roundTripMs ?? 0) > FAR_MS;
    if (nowMs - this.#sentMs < (far ? ACK_EVERY_MS / 2 : ACK_EVERY_MS)) return null;
    this.#sentMs = nowMs;
    this.#acknowledged = this.#received;
    return this.#received;
  }
}

const FIRST_CEILING_MS = 500;
const LAST_CEILING_MS = 30_000;
const SPREAD_S = 10;
/** The wait if a full relay does not specify one. */
export const WAIT_S = 30;
/** The shortest wait for a robot that is absent; the longest is twice that. */
const LATER_MS = 30_000;

/**
 * Milliseconds to wait before the next try; null: don't retry automatically. The wait is random between 0 and a ceiling that
 * doubles with each failure ("full jitter"), so that viewers who lost their relay together don't come back together.
 *
 * `failures` counts failed tries since the stream last worked, `random` is in [0, 1), and `retryS` is the wait in seconds from
 * the relay's `bye`.
 */
export function retryDelayMs(
  rule: Retry,
  failures: number,
  random: number,
  retryS: number | null,
): number | null {
  const backoff = random * Math.min(LAST_CEILING_MS, FIRST_CEILING_MS * 2 ** failures);
  switch (rule) {
    case 'never':
      return null;
    case 'backoff':
      return backoff;
    case 'spread':
      return failures === 0 ? random * (retryS ?? SPREAD_S) * 1000 : backoff;
    case 'wait':
      return (retryS ?? WAIT_S) * 1000 + backoff;
    case 'later':
      return LATER_MS * (1 + random);
  }
}
