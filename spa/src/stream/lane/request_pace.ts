/** Requests that may follow one another at once: the lane's starting point, its newest part, the schema, the next part. */
const BURST = 4;
const EVERY_MS = 1000;

/** Half a request is credited for each part received: a page that is behind must read faster than a robot sends. */
const FOR_A_PART = 0.5;

/** Allows one request a second on average, and a few at once after a rest, whatever the relay answers; two a second if each
 *  brings a part. */
export class RequestPace {
  #left = BURST;
  #atMs = Number.NEGATIVE_INFINITY;

  /** When the next request may be sent. */
  whenFree(nowMs: number): number {
    this.#refill(nowMs);
    return this.#left >= 1 ? nowMs : nowMs + (1 - this.#left) * EVERY_MS;
  }

  recordRequest(nowMs: number): void {
    this.#refill(nowMs);
    this.#left -= 1;
  }

  recordPart(): void {
    this.#left = Math.min(BURST, this.#left + FOR_A_PART);
  }

  #refill(nowMs: number): void {
    this.#left = Math.min(BURST, this.#left + (nowMs - this.#atMs) / EVERY_MS);
    this.#atMs = nowMs;
  }
}
