import type { ShownFrame } from '../lane_port.ts';

/** A frame of a part. `atMs`: when the relay accepted it, unix ms; `liveMs`: by when a socket would have delivered it, viewer's
 *  clock. */
export interface PartFrame extends Omit<ShownFrame, 'atMs'> {
  readonly runId: string;
  readonly atMs: number;
  readonly liveMs: number;
}

const SEQS = 2 ** 32; // frame numbers wrap around
/** The number of earlier runs that are remembered. */
const RUNS_MAX = 16;
/** The maximum difference between the clocks of two relays. */
const CLOCKS_MS = 1000;
/** The maximum error of `liveMs`: once the lane's position is found, and before. */
const UNSURE_MS = 2000;
const UNSURE_AT_FIRST_MS = 8000;

/**
 * Decides whether a frame may be shown: no frame twice, and none older than what was shown.
 *
 * Within a lane (run, seq) decides, because each part names its run. A socket does not name it. Frames shown by a socket are
 * known by schema, number and robot time, and by their arrival. A frame of the lane is therefore new if its time is later and, as
 * long as that time is uncertain, if its number or its robot time is greater. A robot that restarted within these seconds, and
 * counts both from 0, stands still until they are over.
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

  /** Records a frame, and returns whether to show it. `isFound`: `liveMs` is exact, not just a bound. */
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
