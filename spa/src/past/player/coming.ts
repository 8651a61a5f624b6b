import type { PastSource } from '../past_source.ts';
import { thinned } from './fill.ts';
import { type Loads, PAGE_MS } from './tape/loads.ts';
import type { OwnTape } from './tape/own_tape.ts';
import { AROUND_MAX, type Reel } from './tape/reel.ts';
import { nameOfRef, type Tape, type TapeFrame } from './tape/tape.ts';

/** How far it looks ahead, ms. */
export const COMING_MS = 30_000;
/** Maximum number of segments being loaded or decoded for it. */
const AT_ONCE = 2;
/** The result is valid for this long, ms. */
const GOOD_MS = 200;

export interface ComingPorts {
  readonly source: PastSource;
  readonly own: OwnTape;
  readonly nowMs: () => number;
}

/** The frames after the shown one, for plots of the minute around it. Nothing is fetched before somebody asks. */
export class Coming {
  #found: { readonly frames: TapeFrame[]; readonly last: TapeFrame; readonly nowMs: number } | null = null;
  /** Segments in range that were already requested: the tape may have dropped them since, for lack of space. */
  #begun: ReadonlySet<string> = new Set();

  constructor(
    private readonly ports: ComingPorts,
    private readonly tape: Tape,
    private readonly reel: Reel,
    private readonly loads: Loads,
  ) {}

  /** The loaded frames in the half minute after one, thinned, oldest first. Starts to fetch missing ones. */
  after(last: TapeFrame): readonly TapeFrame[] {
    const nowMs = this.ports.nowMs();
    const before = this.#found;
    const isGood =
      before !== null && nowMs - before.nowMs < GOOD_MS && Math.abs(last.atMs - before.last.atMs) < 1000;
    const frames = isGood ? before.frames : this.#collect(last);
    if (!isGood) this.#found = { frames, last, nowMs };
    return frames.filter((frame) => this.tape.order(frame, last) > 0);
  }

  #collect(last: TapeFrame): TapeFrame[] {
    const { source, own } = this.ports;
    const untilMs = last.atMs + COMING_MS;
    if (untilMs <= (source.timeline?.toMs ?? 0)) void this.loads.index(Math.floor(untilMs / PAGE_MS));
    const refs = this.reel
      .ahead(last.atMs, Number.POSITIVE_INFINITY, AROUND_MAX)
      .filter(({ frames, fromMs }) => frames > 0 && fromMs <= untilMs);
    const names = refs.map(nameOfRef);
    const begun = new Set(names.filter((name) => this.#begun.has(name)));
    const found: TapeFrame[] = [];
    let busy = refs.filter((ref) => this.loads.stateOfRef(ref) === 'loading').length;
    let opened = 0;
    for (const ref of refs) {
      const part = this.tape.get(ref);
      if (part !== null) {
        if (!part.isOpen) opened += 1;
        if (part.isOpen || opened <= AT_ONCE) found.push(...this.reel.framesOf(ref));
        continue;
      }
      const state = this.loads.stateOfRef(ref);
      if (busy >= AT_ONCE || (state === 'none' && begun.has(nameOfRef(ref)))) continue;
      if (state !== 'none' && state !== 'away') continue;
      begun.add(nameOfRef(ref));
      busy += 1;
      void this.loads.segment(ref);
    }
    this.#begun = begun;
    this.tape.trim(last.atMs);
    found.push(...own.since(last.atMs));
    const isBehind = (frame: TapeFrame) =>
      frame.atMs <= untilMs && frame.schemaId === last.schemaId && this.tape.order(frame, last) > 0;
    return thinned(found.filter(isBehind).sort((a, b) => this.tape.order(a, b)));
  }
}
