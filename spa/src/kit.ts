/** What a stream tells: calls its listeners whenever something has happened, without a value of its own. */
export class Emitter {
  readonly #listeners = new Set<() => void>();

  /** Adds a listener. Returns a function that removes it. Bound, so that `useSyncExternalStore` takes it as it is. */
  readonly on = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  readonly emit = (): void => {
    for (const listener of this.#listeners) listener();
  };

  /** Removes all listeners. */
  clear(): void {
    this.#listeners.clear();
  }
}

