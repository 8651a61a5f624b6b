interface Entry<V> {
  readonly value: V;
  readonly cost: number;
}

/** Values by key, what was used last kept longest: together they cost no more than `costMax`, but the newest stays. */
export class BoundedCache<K, V> {
  readonly #costMax: number;
  readonly #entries = new Map<K, Entry<V>>(); // used last stands last
  #cost = 0;

  constructor(costMax: number) {
    this.#costMax = costMax;
  }

  /** The value, which counts as used now. */
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
