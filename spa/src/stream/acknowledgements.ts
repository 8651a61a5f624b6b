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
