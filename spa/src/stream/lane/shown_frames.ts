import type { ShownFrame } from '../lane_port.ts';

/** A frame of a part. `atMs`: when the relay accepted it, unix ms; `liveMs`: by when a socket would have brought it, viewer's
 *  clock. */
export interface PartFrame extends Omit<ShownFrame, 'atMs'> {
  readonly runId: string;
  readonly atMs: number;
  readonly liveMs: number;
}

const SEQS = 2 ** 32; // a frame's number goes round
/** Runs of before that are remembered. */
const RUNS_MAX = 16;
/** By so much the clocks of two relays may differ. */
const CLOCKS_MS = 1000;
/** By so much `liveMs` may be too late; once the lane's own place is found, and before. */
const UNSURE_MS = 2000;
const UNSURE_AT_FIRST_MS = 8000;

/**
 * Tells whether a frame may be shown: none twice, and none that is older than what was shown.
 *
 * Within a lane (run, seq) decides, since each part names its run. A socket does not name it. What it has shown is known by
 * schema, number and robot time, and by when it came; so a frame of the lane is new if it is of a later time, and, for as long
 * as that time is unsure, if its number or its robot time is the greater one. A robot that was started anew in these seconds,
 * and counts both from 0, stands still until they are over.
 */
export class ShownFrames {
  readonly #before: ShownFrame | null;
  #runId: string | null = null;
  #seq = 0;
  #atMs = 0;
  #runs: string[] = [];

  /** `before`: what was shown before this lane began. */
  constructor(before: ShownFrame | null) {
    this.#before = before;
  }

  /** Notes a frame, and returns whether it is to be shown. `isFound`: whether `liveMs` is more than a bound. */
  show(frame: PartFrame, isFound: boolean): boolean {
    if (!this.#isNew(frame, isFound)) return false;
    if (this.#runId !== null && this.#runId !== frame.runId)
      this.#runs = [...this.#runs, this.#runId].slice(-RUNS_MAX);
    this.#runId = frame.runId;
    this.#seq = frame.seq;
    this.#atMs = frame.atMs;
    return true;
  }

  #isNew(frame: PartFrame, isFound: boolean): boolean {
    if (frame.runId === this.#runId) return isAfter(frame.seq, this.#seq);
    if (this.#runId !== null) return !this.#runs.includes(frame.runId) && frame.atMs > this.#atMs - CLOCKS_MS;
    const before = this.#before;
    if (before === null) return true;
    if (frame.liveMs <= before.atMs) return false;
    const isLater =
      isAfter(frame.seq, before.seq) || frame.tS > before.tS || frame.schemaId !== before.schemaId;
    return isLater || frame.liveMs > before.atMs + (isFound ? UNSURE_MS : UNSURE_AT_FIRST_MS);
  }
}

function isAfter(seq: number, other: number): boolean {
  const by = (seq - other + SEQS) % SEQS;
  return by > 0 && by < SEQS / 2;
}
