import type { ViewerMessage } from '@posecast/wire';

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
