import { remember } from '../../kit.ts';

/**
 * Compares the arrival times of one stream's frames with the robot's timestamps. Pure: it takes timestamps and arrival times, and
 * computes the delay at which the frames can be played smoothly.
 *
 * Timestamps are mapped to the viewer's clock by the smallest (arrival − timestamp) of the newest frames, which is assumed to
 * belong to a frame that met no queue. The lateness of a frame is its additional delay.
 */

/** How many frames are remembered. */
export const REMEMBERED = 64;
/** Upper bound of the delay: poses shown any later would be too old for a monitor. */
export const MOST_DELAY_MS = 300;
/** The interval assumed until two moving frames have arrived. */
const FIRST_GUESS_MS = 1000 / 30;
/** If a robot's clock differs in speed by more than this fraction, it is a slow or fast simulation; less is drift and jitter. */
const OTHER_PACE = 0.05;
const LEAST_FOR_PACE_MS = 1000;
/** After a gap of more than this many periods, the robot is assumed to have stood still and to start moving only now. */
const STOOD_STILL = 2.5;

export interface Stamp {
  seq: number;
  /** Robot time, seconds. */
  tS: number;
  /** Arrival, viewer's clock. */
  atMs: number;
}

/** A frame's time on the stream's own time line (ms, from an arbitrary zero), and how long its motion up to there took.
 *  */
export interface Placed {
  lineMs: number;
  moveMs: number;
}

/** Estimates interval and delay of one stream from its newest frames. */
export class Arrivals {
  /** (arrival − line) of the newest frames, ms. */
  readonly #offsets: number[] = [];
  /** Times between successive moving frames, ms. */
  readonly #moves: number[] = [];
  /** The same divided by the steps in `seq`: a relay that thins a stream skips numbers, a robot at rest does not. */
  readonly #periods: number[] = [];
  readonly #stamps: Stamp[] = [];
  #lineMs = 0;
  #moved = false;
  #offsetMs = 0;
  #intervalMs = FIRST_GUESS_MS;
  #delayMs = FIRST_GUESS_MS;

  /** Takes a frame that is newer than all before it. `moves`: its pose differs from the previous one. */
  add(stamp: Stamp, moves: boolean): Placed {
    const before = this.#stamps.at(-1);
    const sinceMs = before === undefined ? 0 : (stamp.tS - before.tS) * 1000 * this.#pace();
    const numbers = before === undefined ? 1 : Math.max(1, stamp.seq - before.seq);
    this.#lineMs += sinceMs;
    if (moves && this.#moved && before !== undefined) {
      remember(this.#periods, sinceMs / numbers, REMEMBERED);
      remember(this.#moves, this.#moveMs(sinceMs, numbers), REMEMBERED);
    }
    this.#moved = moves;
    remember(this.#stamps, stamp, REMEMBERED);
    remember(this.#offsets, stamp.atMs - this.#lineMs, REMEMBERED);
    this.#judge(); // computed here, once a frame, rather than at every repaint
    return { lineMs: this.#lineMs, moveMs: this.#moveMs(sinceMs, numbers) };
  }

  /** Offset of the line to the viewer's clock, ms: line + offset is the earliest time at which a frame can arrive. */
  get offsetMs(): number {
    return this.#offsetMs;
  }

  /** Median time between moving frames, ms. */
  get intervalMs(): number {
    return this.#intervalMs;
  }

  /** One interval plus the 95th percentile of lateness, ms. */
  get delayMs(): number {
    return this.#delayMs;
  }

  #judge(): void {
    const earliest = Math.min(...this.#offsets);
    const late = quantile(this.#offsets, 0.95) - earliest;
    this.#offsetMs = earliest;
    if (this.#moves.length > 0) this.#intervalMs = quantile(this.#moves, 0.5);
    this.#delayMs = Math.min(MOST_DELAY_MS, this.#intervalMs + late);
  }

  #moveMs(sinceMs: number, numbers: number): number {
    const periodMs = this.#periods.length === 0 ? FIRST_GUESS_MS : Math.max(1, Math.min(...this.#periods));
    const usual = periodMs * numbers;
    return sinceMs > STOOD_STILL * usual ? 1.5 * usual : sinceMs;
  }

  /** ms of the viewer's clock for each ms of the robot's. */
  #pace(): number {
    const first = this.#stamps[0];
    const last = this.#stamps.at(-1);
    if (first === undefined || last === undefined || last.atMs - first.atMs < LEAST_FOR_PACE_MS) return 1;
    const pace = (last.atMs - first.atMs) / ((last.tS - first.tS) * 1000);
    return Math.abs(pace - 1) > OTHER_PACE && Number.isFinite(pace) ? pace : 1;
  }
}

/** The quantile `part` (0…1) of the values by nearest rank; 0 of none. */
function quantile(values: readonly number[], part: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.ceil(part * sorted.length) - 1)] ?? 0;
}
