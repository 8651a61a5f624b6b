import { nameOfRef, type PastSource } from '../past_source.ts';
import { PAGE_MS, type PastSink, type PastState, type Span } from '../past_types.ts';
import type { Loads } from './tape/loads.ts';
import type { OwnTape } from './tape/own_tape.ts';
import { AROUND_MAX, type Reel } from './tape/reel.ts';
import type { Tape, TapeFrame } from './tape/tape.ts';

/** Minimum time between two states that fill a plot, ms. */
const FILL_EVERY_MS = 100;
/** How far back a plot is filled, ms. */
const FILL_MS = 60_000;
/** After a jump, filling starts this much later, ms, because another jump may follow. */
const AFTER_MS = 250;

export interface FillPorts {
  readonly source: PastSource;
  readonly own: OwnTape;
  readonly sink: PastSink;
  readonly schedule: (run: () => void, afterMs: number) => () => void;
}

/** Sends a sink the states before a moment, for its plots: in the background, until it is stopped. */
export class Fill {
  #cancel = (): void => undefined;
  #runs = 0;

  /** `onFilled` is called when the sink has received a minute. */
  constructor(
    private readonly ports: FillPorts,
    private readonly tape: Tape,
    private readonly reel: Reel,
    private readonly loads: Loads,
    private readonly onFilled: () => void,
  ) {}

  stop(): void {
    this.#runs += 1;
    this.#cancel();
  }

  /** Reads the minute before a frame, soon. */
  soon(last: TapeFrame): void {
    this.stop();
    const run = this.#runs;
    this.#cancel = this.ports.schedule(() => {
      void this.#collect({ fromMs: last.atMs - FILL_MS, toMs: last.atMs }, last, run).then((states) => {
        if (states.length === 0 || run !== this.#runs) return;
        this.ports.sink.fill(last.schema, states);
        this.onFilled();
      });
    }, AFTER_MS);
  }

  /** The states of a span up to `last`, thinned, oldest first, as far as available. */
  async #collect(span: Span, last: TapeFrame, run: number): Promise<readonly PastState[]> {
    const { source, own } = this.ports;
    const found: TapeFrame[] = [];
    const add = (frames: readonly TapeFrame[]): void => {
      found.push(
        ...thinned(
          frames.filter(
            (frame) =>
              frame.atMs >= span.fromMs &&
              frame.schemaId === last.schemaId &&
              this.tape.order(frame, last) <= 0,
          ),
        ),
      );
    };
    const refs = source
      .segmentsIn(span)
      .filter(({ frames }) => frames > 0)
      .slice(-AROUND_MAX);
    for (const ref of refs.toReversed()) {
      await this.loads.segment(ref);
      await this.#pause(); // decoding takes a moment, and a picture may be due
      if (run !== this.#runs) return [];
      add(this.reel.framesOf(ref));
      this.tape.trim(last.atMs);
    }
    add(own.since(span.fromMs));
    return thinned(found.sort((a, b) => this.tape.order(a, b)));
  }

  #pause(): Promise<void> {
    return new Promise((resolve) => {
      this.ports.schedule(resolve, 0);
    });
  }
}

/** As many of the ordered states as a plot can show. */
export function thinned(frames: readonly TapeFrame[]): TapeFrame[] {
  let beforeMs = Number.NEGATIVE_INFINITY;
  return frames.filter(({ atMs }) => {
    if (atMs - beforeMs < FILL_EVERY_MS) return false;
    beforeMs = atMs;
    return true;
  });
}

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
