interface Entry<V> {
  readonly value: V;
  readonly cost: number;
}

/** A least-recently-used cache: the total cost stays within `costMax`, except that the newest entry is always kept. */
export class BoundedCache<K, V> {
  readonly #costMax: number;
  readonly #entries = new Map<K, Entry<V>>(); // most recently used last
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
