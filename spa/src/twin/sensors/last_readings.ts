import { type Field, MISSING, type Schema } from '@posecast/wire';
import type { RobotState } from '../robot.ts';

/** Finds joints that have lost their reading. A joint that never had one is left out: the table shows that it has none. */
export class LostReadings {
  readonly #schema: Schema;
  readonly #read = new Set<string>();

  constructor(schema: Schema) {
    this.#schema = schema;
  }

  /** The joints, by the robot's names, whose position was read before and is missing in these codes. */
  update(codes: Int32Array): string[] {
    const pos = this.#schema.field('pos');
    const lost: string[] = [];
    pos?.labels.forEach((joint, i) => {
      if (codes[pos.start + i] !== MISSING) this.#read.add(joint);
      else if (this.#read.has(joint)) lost.push(joint);
    });
    return lost;
  }
}

/**
 * Keeps the last reading of every channel and the time at which it was lost. If one of a robot's boards fails, frames continue
 * without its readings, and the page can show the last ones, marked as old. A new schema restarts it.
 */
export class LastReadings {
  #schema: Schema | null = null;
  #codes = new Int32Array(0);
  /** For each channel, when its last reading arrived, ms; NaN while it has one, or never had one. */
  #lostMs = new Float64Array(0);
  #newestMs = Number.NaN;
  #lost = 0;

  push(schema: Schema, state: RobotState): void {
    if (schema !== this.#schema) this.#begin(schema);
    const { codes } = state;
    for (let i = 0; i < this.#codes.length; i += 1) {
      const code = codes[i]!;
      const lost = this.#lostMs[i]!;
      if (code !== MISSING) {
        this.#codes[i] = code;
        if (Number.isNaN(lost)) continue;
        this.#lostMs[i] = Number.NaN;
        this.#lost -= 1;
      } else if (Number.isNaN(lost) && this.#codes[i] !== MISSING) {
        this.#lostMs[i] = this.#newestMs;
        this.#lost += 1;
      }
    }
    this.#newestMs = state.atMs;
  }

  /** Forgets all readings. */
  clear(): void {
    this.#schema = null;
  }

  /** Codes like a frame's, with the last reading where the newest frame has none. */
  get codes(): Int32Array {
    return this.#codes;
  }

  /** Whether any channel has lost its reading. */
  get anyLost(): boolean {
    return this.#lost > 0;
  }

  /** When a channel without a reading now had its last, ms of the viewer's clock; null for one that has a reading or
   *  never had one. */
  lostMs(field: Field | null, index: number): number | null {
    if (field === null || index < 0 || index >= field.size || this.#schema?.field(field.name) !== field)
      return null;
    const at = this.#lostMs[field.start + index]!;
    return Number.isNaN(at) ? null : at;
  }

  #begin(schema: Schema): void {
    this.#schema = schema;
    this.#codes = new Int32Array(schema.size).fill(MISSING);
    this.#lostMs = new Float64Array(schema.size).fill(Number.NaN);
    this.#newestMs = Number.NaN;
    this.#lost = 0;
  }
}
