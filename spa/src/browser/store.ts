/** One value for the whole page, and those who are told when another takes its place. */
export interface Store<T> {
  readonly get: () => T;
  /** Takes over a value and calls every listener, also when the value is the same. */
  readonly set: (next: T) => void;
  /** Returns the end of it. */
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
