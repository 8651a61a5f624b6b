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
  const listeners = new Set<() => void>();
  return {
    get: () => value,
    set: (next) => {
      value = next;
      for (const listener of listeners) listener();
    },
    subscribe: (listener) => {
      listeners.add(listener);
      return () => listeners.delete(listener);
    },
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
