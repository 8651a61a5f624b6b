import type { Schema } from '@posecast/wire';
import { HISTORY_S, type History } from './history.ts';

/** Maximum number of states computed in one `update`: the last minute, of 600 states, is complete after ten. */
export const COMPUTED_AT_ONCE = 60;
/** Minimum number of expired states before they are dropped. */
const KEPT = 900;

/** Writes the values computed from a frame's codes, in the columns' units; NaN: none. */
export type Compute = (codes: Int32Array, atMs: number, into: Float64Array) => void;

/**
 * Values over the last minute that are expensive to compute, for the states in a `History`. Each is computed once, a few per
 * `update`, newest first; values not yet computed are null.
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

  /** Computes some values for the minute ending at `nowMs`. True if there is more to compute. Does nothing if the schema
   *  differs. */
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
