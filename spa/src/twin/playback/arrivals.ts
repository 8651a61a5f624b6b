/**
 * When the frames of one stream arrive, against when the robot stamped them. Pure: stamps and arrivals go in, the
 * delay at which they can be played smoothly comes out.
 *
 * A stamp is placed on the viewer's clock by the smallest (arrival − stamp) of the newest frames: the luckiest of them
 * met no queue. What the others took longer is their lateness.
 */

/** As many frames are remembered; the oldest goes first. */
export const REMEMBERED = 64;
/** Older than this a pose would be no monitor's any more. */
export const MOST_DELAY_MS = 300;
/** Until two moving frames have come. */
const FIRST_GUESS_MS = 1000 / 30;
/** A robot whose clock runs this much off ours is a simulation that runs slow or fast; less is drift and jitter. */
const OTHER_PACE = 0.05;
const LEAST_FOR_PACE_MS = 1000;
/** Longer than so many periods since the frame before: it stood still for a while, and began to move only now. */
const STOOD_STILL = 2.5;

export interface Stamp {
  seq: number;
  /** Robot time, seconds. */
  tS: number;
  /** Arrival, viewer's clock. */
  atMs: number;
}

/** Where a frame lies on the stream's own line of time (ms; its zero means nothing), and for how long it moved there. */
export interface Placed {
  lineMs: number;
  moveMs: number;
}

export class Arrivals {
  /** (arrival − line) of the newest frames, ms. */
  readonly #offsets: number[] = [];
  /** ms from moving frame to moving frame. */
  readonly #moves: number[] = [];
  /** The same for each number of the sequence: a relay that thins a stream leaves out numbers, a still robot none. */
  readonly #periods: number[] = [];
  readonly #stamps: Stamp[] = [];
  #lineMs = 0;
  #moved = false;
  #offsetMs = 0;
  #intervalMs = FIRST_GUESS_MS;
  #delayMs = FIRST_GUESS_MS;

  /** Takes a frame that is newer than all before it; `moves`: it shows another pose than the one before. */
  add(stamp: Stamp, moves: boolean): Placed {
    const before = this.#stamps.at(-1);
    const sinceMs = before === undefined ? 0 : (stamp.tS - before.tS) * 1000 * this.#pace();
    const numbers = before === undefined ? 1 : Math.max(1, stamp.seq - before.seq);
    this.#lineMs += sinceMs;
    if (moves && this.#moved && before !== undefined) {
      remember(this.#periods, sinceMs / numbers);
      remember(this.#moves, this.#moveMs(sinceMs, numbers));
    }
    this.#moved = moves;
    remember(this.#stamps, stamp);
    remember(this.#offsets, stamp.atMs - this.#lineMs);
    this.#judge(); // once a frame, not once a repaint
    return { lineMs: this.#lineMs, moveMs: this.#moveMs(sinceMs, numbers) };
  }

  /** The line's place on the viewer's clock: line + offset = the earliest that a frame can be here. */
  get offsetMs(): number {
    return this.#offsetMs;
  }

  /** From one moving frame to the next. */
  get intervalMs(): number {
    return this.#intervalMs;
  }

  /** One interval, and what nineteen of twenty frames are late at most. */
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

function remember<T>(list: T[], item: T): void {
  list.push(item);
  if (list.length > REMEMBERED) list.shift();
}

/** The value that this part of them does not exceed. */
function quantile(values: readonly number[], part: number): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.ceil(part * sorted.length) - 1)] ?? 0;
}
