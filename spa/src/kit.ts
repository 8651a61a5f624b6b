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

/** A value that the whole page shares, with listeners for changes. */
export interface Store<T> {
  readonly get: () => T;
  /** Sets the value and calls every listener, even if the value is the same. */
  readonly set: (next: T) => void;
  /** Adds a listener. Returns a function that removes it. */
  readonly subscribe: (listener: () => void) => () => void;
}

export function createStore<T>(first: T): Store<T> {
  let value = first;
  const changed = new Emitter();
  return {
    get: () => value,
    set: (next) => {
      value = next;
      changed.emit();
    },
    subscribe: changed.on,
  };
}

/** Gives each of some objects its own store, which lives as long as the object. */
export function storePer<K extends object, T>(first: T): (key: K) => Store<T> {
  const stores = new WeakMap<K, Store<T>>();
  return (key) => {
    const known = stores.get(key) ?? createStore(first);
    stores.set(key, known);
    return known;
  };
}
