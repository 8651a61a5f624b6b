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

/** Makes one thing for each of some objects, when it is first asked for. It lives as long as the object. */
export function perObject<K extends object, T>(make: (key: K) => T): (key: K) => T {
  const made = new WeakMap<K, T>();
  return (key) => {
    if (!made.has(key)) made.set(key, make(key));
    return made.get(key)!;
  };
}
