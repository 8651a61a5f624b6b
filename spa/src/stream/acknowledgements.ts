/** Acknowledgements are this far apart at least. */
const ACK_EVERY_MS = 1000;
/** Far away: the relay receives an acknowledgement so late that it would hold frames back while it waits for the next. */
const FAR_MS = 500;

/** How many binary messages of one connection have come, and when the relay is to be told. */
export class Acknowledgements {
  #received = 0;
  #acknowledged = 0;
  #sentMs = Number.NEGATIVE_INFINITY;

  countMessage(): void {
    this.#received += 1;
  }

  /** The number to acknowledge now, at most once a second (twice, from afar), and never left owing; null: nothing is due. */
  takeDue(nowMs: number, roundTripMs: number | null): number | null {
    if (this.#received === this.#acknowledged) return null;
    const far = (roundTripMs ?? 0) > FAR_MS;
    if (nowMs - this.#sentMs < (far ? ACK_EVERY_MS / 2 : ACK_EVERY_MS)) return null;
    this.#sentMs = nowMs;
    this.#acknowledged = this.#received;
    return this.#received;
  }
}
