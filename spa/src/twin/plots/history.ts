import { MISSING, type Schema } from '@posecast/wire';
import type { RobotState } from '../robot.ts';
import { type ChannelReader, valueAt } from '../values.ts';

/** Length of the history, and minimum time between its samples: 600 samples, as many as a strip of 600 pixels can show. */
export const HISTORY_S = 60;
const STEP_MS = 100;
const SAMPLES = (HISTORY_S * 1000) / STEP_MS;
/** Upper bound of the memory; for a robot with very many channels the history is shorter. */
const BYTES_MAX = 4_000_000;

/** The history of one channel. */
export interface TraceHistory {
  /** Seconds before (≤ 0) or after `nowMs`, oldest first. */
  readonly agoS: readonly number[];
  /** In the schema's unit; null if there was no reading. */
  readonly values: readonly (number | null)[];
}

/** The history as read by some readers, oldest first. */
export interface Window {
  /** When each frame arrived, ms of the viewer's clock. */
  readonly atMs: readonly number[];
  /** One for each reader, as long as `atMs`. */
  readonly columns: readonly (readonly (number | null)[])[];
}

/** What the history keeps for a state. */
type Sample = Pick<RobotState, 'codes' | 'atMs'> & Partial<RobotState>;

/** The last minute of every channel, as codes in a ring buffer. A frame with another schema restarts it. */
export class History {
  #schema: Schema | null = null;
  #codes = new Int32Array(0);
  #atMs = new Float64Array(0);
  #next = 0;
  #count = 0;
  #newestMs = Number.NEGATIVE_INFINITY;

  /** Adds a state, unless the last one added is less than 100 ms older. */
  push(schema: Schema, state: Sample): void {
    if (schema !== this.#schema) this.#begin(schema);
    if (state.atMs - this.#newestMs < STEP_MS) return;
    this.#newestMs = state.atMs;
    this.#codes.set(state.codes.subarray(0, schema.size), this.#next * schema.size);
    this.#atMs[this.#next] = state.atMs;
    this.#next = (this.#next + 1) % this.#atMs.length;
    this.#count = Math.min(this.#count + 1, this.#atMs.length);
  }

  /** One channel's last minute; empty if there is no such channel. */
  trace(fieldName: string, label: string, nowMs: number): TraceHistory {
    const field = this.#schema?.field(fieldName) ?? null;
    const index = field?.labels.indexOf(label) ?? -1;
    if (field === null || index < 0) return { agoS: [], values: [] };
    const { atMs, columns } = this.window([(codes) => valueAt(codes, field, index)], nowMs);
    return { agoS: atMs.map((at) => (at - nowMs) / 1000), values: columns[0] ?? [] };
  }

  /** The last minute as each of `readers` reads it, oldest first. Readers get codes of the schema that was pushed last.
   *  */
  window(readers: readonly ChannelReader[], nowMs: number): Window {
    const atMs: number[] = [];
    const columns: (number | null)[][] = readers.map(() => []);
    const size = this.#schema?.size ?? 0;
    for (let i = this.#count; i > 0; i -= 1) {
      const slot = (this.#next - i + this.#atMs.length) % this.#atMs.length;
      const at = this.#atMs[slot]!;
      if (at < nowMs - HISTORY_S * 1000 || at > nowMs) continue;
      atMs.push(at);
      const codes = this.#codes.subarray(slot * size, (slot + 1) * size);
      readers.forEach((read, column) => {
        columns[column]!.push(read(codes, at));
      });
    }
    return { atMs, columns };
  }

  /** Inserts older states in front of its oldest one; ignores them if the schema differs. `states`: oldest first. */
  prepend(schema: Schema, states: readonly Sample[]): void {
    if (this.#schema !== null && schema !== this.#schema) return;
    const kept = this.#samples();
    const oldestMs = kept[0]?.atMs ?? Number.POSITIVE_INFINITY;
    this.clear();
    for (const sample of [...states.filter(({ atMs }) => atMs < oldestMs), ...kept])
      this.push(schema, sample);
  }

  /** Forgets all states. */
  clear(): void {
    this.#count = 0;
    this.#newestMs = Number.NEGATIVE_INFINITY;
  }

  /** A copy that later frames don't change, for a paused plot. */
  copy(): History {
    const made = new History();
    made.#schema = this.#schema;
    made.#codes = this.#codes.slice();
    made.#atMs = this.#atMs.slice();
    made.#next = this.#next;
    made.#count = this.#count;
    return made;
  }

  /** The schema of the frames in it; null before the first. */
  get schema(): Schema | null {
    return this.#schema;
  }

  /** Copies of all that is kept, oldest first. */
  #samples(): Sample[] {
    const size = this.#schema?.size ?? 0;
    return Array.from({ length: this.#count }, (_, i) => {
      const slot = (this.#next - this.#count + i + this.#atMs.length) % this.#atMs.length;
      return { codes: this.#codes.slice(slot * size, (slot + 1) * size), atMs: this.#atMs[slot]! };
    });
  }

  /** Memory used, bytes. It does not grow after the first frame of a schema. */
  get bytes(): number {
    return this.#codes.byteLength + this.#atMs.byteLength;
  }

  #begin(schema: Schema): void {
    this.#schema = schema;
    const samples = Math.max(1, Math.min(SAMPLES, Math.floor(BYTES_MAX / 4 / Math.max(1, schema.size))));
    this.#codes = new Int32Array(samples * schema.size).fill(MISSING);
    this.#atMs = new Float64Array(samples);
    this.#next = 0;
    this.#count = 0;
    this.#newestMs = Number.NEGATIVE_INFINITY;
  }
}

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
