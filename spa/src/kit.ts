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

/** Calls a function `ms` after the last `restart`, unless it is cancelled first. */
export class Debounce {
  readonly #ms: number;
  readonly #what: () => void;
  #timer: ReturnType<typeof setTimeout> | null = null;

  constructor(ms: number, what: () => void) {
    this.#ms = ms;
    this.#what = what;
  }

  /** Whether a call is pending. */
  get pending(): boolean {
    return this.#timer !== null;
  }

  /** Restarts the waiting time. */
  restart(): void {
    this.cancel();
    this.#timer = setTimeout(() => {
      this.#timer = null;
      this.#what();
    }, this.#ms);
  }

  cancel(): void {
    if (this.#timer !== null) clearTimeout(this.#timer);
    this.#timer = null;
  }
}

/** A least-recently-used cache: the total cost stays within `costMax`, except that the newest entry is always kept. */
export class BoundedCache<K, V> {
  readonly #costMax: number;
  readonly #entries = new Map<K, { readonly value: V; readonly cost: number }>(); // most recently used last
  #cost = 0;

  constructor(costMax: number) {
    this.#costMax = costMax;
  }

  /** The value, which becomes the most recently used. */
  use(key: K): V | undefined {
    const entry = this.#entries.get(key);
    if (entry === undefined) return undefined;
    this.#entries.delete(key);
    this.#entries.set(key, entry);
    return entry.value;
  }

  get(key: K): V | undefined {
    return this.#entries.get(key)?.value;
  }

  set(key: K, value: V, cost: number): void {
    this.delete(key);
    this.#entries.set(key, { value, cost });
    this.#cost += cost;
    for (const oldest of this.#entries.keys()) {
      if (this.#cost <= this.#costMax || this.#entries.size === 1) break;
      this.delete(oldest);
    }
  }

  delete(key: K): void {
    this.#cost -= this.#entries.get(key)?.cost ?? 0;
    this.#entries.delete(key);
  }

  clear(): void {
    this.#entries.clear();
    this.#cost = 0;
  }

  entries(): [K, V][] {
    return [...this.#entries].map(([key, { value }]) => [key, value]);
  }
}

/** A span of time, unix ms. */
export interface Span {
  readonly fromMs: number;
  readonly toMs: number;
}

/** Whether a moment lies in one of these spans, without their ends. */
export function isWithin(atMs: number, spans: readonly Span[]): boolean {
  return spans.some(({ fromMs, toMs }) => atMs >= fromMs && atMs < toMs);
}

/** The members of an untrusted object; none of anything else. */
export function fieldsOf(value: unknown): Readonly<Record<string, unknown>> {
  return typeof value === 'object' && value !== null ? (value as Record<string, unknown>) : {};
}

/** The index of the first item for which `is` holds; it must hold for all later ones too. */
export function firstPlace<T>(list: ArrayLike<T>, is: (each: T) => boolean): number {
  let [low, high] = [0, list.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (is(list[middle]!)) high = middle;
    else low = middle + 1;
  }
  return low;
}

/** Adds an item; beyond `most` the oldest is dropped. */
export function remember<T>(list: T[], item: T, most: number): void {
  list.push(item);
  if (list.length > most) list.shift();
}

/** Drops the oldest entries beyond `most`. */
export function dropOldest(map: Map<unknown, unknown> | Set<unknown>, most: number): void {
  for (const key of map.keys()) {
    if (map.size <= most) return;
    map.delete(key);
  }
}

/** The bytes of an answer; null if there are more than `most`, which are not read. `heard` gets the size of each chunk. */
export async function readAtMost(
  body: ReadableStream<Uint8Array> | null,
  most: number,
  heard: (bytes: number) => void = () => {},
): Promise<Uint8Array<ArrayBuffer> | null> {
  const pieces: Uint8Array[] = [];
  let size = 0;
  const reader = body?.getReader();
  for (;;) {
    const { value } = (await reader?.read()) ?? {};
    if (value === undefined) return joined(pieces, size);
    size += value.length;
    if (size > most) {
      await reader?.cancel();
      return null;
    }
    heard(value.length);
    pieces.push(value);
  }
}

/** Pieces of `size` bytes in all, as one. */
export function joined(pieces: readonly Uint8Array[], size: number): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(size);
  let at = 0;
  for (const piece of pieces) {
    all.set(piece, at);
    at += piece.length;
  }
  return all;
}

/** Calls `run` for each item, a few at a time, until one rejects. */
export async function eachOf<T>(
  items: Iterable<T>,
  atOnce: number,
  run: (item: T) => Promise<void>,
): Promise<void> {
  const waiting = [...items];
  const work = async (): Promise<void> => {
    for (let item = waiting.shift(); item !== undefined; item = waiting.shift())
      await run(item).catch((error: unknown) => {
        waiting.length = 0;
        throw error;
      });
  };
  await Promise.all(Array.from({ length: atOnce }, work));
}
