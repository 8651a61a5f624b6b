import type { Schema } from '@posecast/wire';
import { HISTORY_S, type History } from './history.ts';

/** Most states that one `update` computes: the last minute, of 600 states, is there after ten. */
export const COMPUTED_AT_ONCE = 60;
/** Least states that are kept before those that have left the minute are dropped. */
const KEPT = 900;

/** Writes the values that are computed from a frame's codes, in the columns' units; NaN: none. */
export type Compute = (codes: Int32Array, atMs: number, into: Float64Array) => void;

/**
 * Values of the last minute that cost more to compute than to read, of the states that a `History` keeps. They are computed once
 * each, a few in every `update`, the newest first; what is still to come is null.
 */
export class DerivedHistory {
  readonly #schema: Schema;
  readonly #columns: number;
  readonly #compute: Compute;
  /** By the time of the state, ms. */
  readonly #kept = new Map<number, Float64Array>();

  constructor(schema: Schema, columns: number, compute: Compute) {
    this.#schema = schema;
    this.#columns = columns;
    this.#compute = compute;
  }

  /** Computes some of what the history has of the minute that ends at `nowMs`. True when there is more to compute. Of another
   *  schema it computes nothing. */
  update(history: History, nowMs: number): boolean {
    if (history.schema !== this.#schema) return false;
    const missing: { codes: Int32Array; atMs: number }[] = [];
    const note = (codes: Int32Array, atMs = 0) => {
      if (!this.#kept.has(atMs)) missing.push({ codes, atMs });
      return null;
    };
    history.window([note], nowMs);
    const chosen = missing.slice(-COMPUTED_AT_ONCE);
    for (const { codes, atMs } of chosen) {
      const values = new Float64Array(this.#columns).fill(Number.NaN);
      this.#compute(codes, atMs, values);
      this.#kept.set(atMs, values);
    }
    if (this.#kept.size > KEPT) this.#drop(nowMs);
    return missing.length > chosen.length;
  }

  /** The value of a column at the time of a state; null: none, or not computed yet. */
  value(column: number, atMs: number): number | null {
    const value = this.#kept.get(atMs)?.[column] ?? Number.NaN;
    return Number.isFinite(value) ? value : null;
  }

  /** How many states are computed, for tests. */
  get size(): number {
    return this.#kept.size;
  }

  #drop(nowMs: number): void {
    for (const atMs of this.#kept.keys())
      if (atMs < nowMs - HISTORY_S * 1000 || atMs > nowMs) this.#kept.delete(atMs);
  }
}
