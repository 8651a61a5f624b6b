/**
 * One slot between the worker and the page. While the page is still busy with the last item a newer one replaces the
 * one that waits: an old pose is worth nothing.
 */
export class Mailbox<T> {
  #waiting: T | null = null;
  #busy = false;
  replaced = 0;

  /** Returns what to hand over now, if anything. */
  put(item: T): T | null {
    if (!this.#busy) {
      this.#busy = true;
      return item;
    }
    if (this.#waiting !== null) this.replaced += 1;
    this.#waiting = item;
    return null;
  }

  /** The other side is ready again. Returns what to hand over now, if anything. */
  taken(): T | null {
    const next = this.#waiting;
    this.#waiting = null;
    this.#busy = next !== null;
    return next;
  }

  /** What waits has lost its meaning. */
  clear(): void {
    this.#waiting = null;
  }
}
