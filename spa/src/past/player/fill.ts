import type { PastSource } from '../past_source.ts';
import type { PastSink, PastState, Span } from '../past_types.ts';
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
