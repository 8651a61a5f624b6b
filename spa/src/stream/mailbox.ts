/**
 * A slot for one item between the worker and the page. While the page is busy with the last item, a newer item replaces the
 * waiting one, because an old pose is worthless.
 */
export class Mailbox<T> {
  #waiting: T | null = null;
  #busy = false;
  /** How many items were replaced before delivery. */
  replaced = 0;

  /** Adds an item. Returns what to hand over now, if anything. */
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

  /** Drops the waiting item. */
  clear(): void {
    this.#waiting = null;
  }
}
