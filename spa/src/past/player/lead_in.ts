import type { PastSource } from '../past_source.ts';
import type { OwnTape } from './tape/own_tape.ts';
import { AROUND_MAX, type Reel } from './tape/reel.ts';
import type { Tape, TapeFrame } from './tape/tape.ts';

/** How far back it goes, ms: as long as footprints are kept. */
export const LEAD_MS = 10_000;
/** Its maximum number of frames. */
export const LEAD_FRAMES_MAX = 300;

export interface LeadInPorts {
  readonly source: PastSource;
  readonly own: OwnTape;
}

/** The states that led up to a frame, for values that depend on history: a velocity, footprints. It fetches nothing. */
export class LeadIn {
  constructor(
    private readonly ports: LeadInPorts,
    private readonly tape: Tape,
    private readonly reel: Reel,
  ) {}

  /** The loaded frames before one, in its run, oldest first. */
  before(last: TapeFrame): readonly TapeFrame[] {
    const { source, own } = this.ports;
    const fromMs = last.atMs - LEAD_MS;
    const found = source
      .segmentsIn({ fromMs, toMs: last.atMs })
      .slice(-AROUND_MAX)
      .flatMap((ref) => (ref.frames > 0 ? this.reel.framesOf(ref) : []));
    this.tape.trim(last.atMs);
    return [...found, ...own.since(fromMs)]
      .filter(
        (frame) =>
          frame.atMs >= fromMs &&
          frame.runId === last.runId &&
          frame.schemaId === last.schemaId &&
          this.tape.order(frame, last) < 0,
      )
      .sort((a, b) => this.tape.order(a, b))
      .filter((frame, i, all) => i === 0 || this.tape.order(all[i - 1]!, frame) !== 0)
      .slice(-LEAD_FRAMES_MAX);
  }
}
