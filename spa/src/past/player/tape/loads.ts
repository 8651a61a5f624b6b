import { dropOldest } from '../../../kit.ts';
import { nameOfRef, PastError, type PastSource, type SegmentRef } from '../../past_source.ts';
import { DAY_MS, MINUTE_MS, PAGE_MS, type Span } from '../../past_types.ts';
import { readerOf, type SchemaReader, type Tape, TapePart } from './tape.ts';

/** Delay before retrying after a failure, ms. */
const RETRY_MS = 2000;
const SCHEMAS_MAX = 8;
/** Interval between first poses when a whole day is browsed, ms. */
const COARSE_MS = MINUTE_MS;

export type LoadState = 'none' | 'loading' | 'ready' | PastError['why'];

interface Load {
  state: LoadState;
  readonly begunMs: number;
  retryMs: number;
  readonly abort: AbortController;
  promise: Promise<void>;
}

/** Requests to a source, by name: each runs only once at a time, and is retried some time after it was `away`. */
export class Loads {
  readonly #loads = new Map<string, Load>();
  readonly #readers = new Map<string, Promise<SchemaReader>>();
  readonly #known = new Map<string, SchemaReader>();

  constructor(
    private readonly source: PastSource,
    private readonly tape: Tape,
    private readonly nowMs: () => number,
    /** Called when something has loaded, or is known to be unavailable. */
    private readonly onChange: () => void,
  ) {}

  stateOf(name: string): LoadState {
    return this.#loads.get(name)?.state ?? 'none';
  }

  stateOfRef(ref: SegmentRef): LoadState {
    if (this.tape.get(ref) !== null) return 'ready';
    return this.stateOf(nameOfRef(ref));
  }

  /** How long a request has been running, ms. */
  waitedMs(name: string): number {
    const load = this.#loads.get(name);
    return load === undefined ? 0 : this.nowMs() - load.begunMs;
  }

  segment(ref: SegmentRef): Promise<void> {
    if (this.tape.get(ref) !== null) return Promise.resolve();
    return this.#load(nameOfRef(ref), async (signal) => {
      const [segment, reader] = await Promise.all([
        this.source.segment(ref, signal),
        ref.schema === null ? null : this.reader(ref.schema),
      ]);
      if (!signal.aborted) this.tape.add(new TapePart(ref, segment, reader));
    });
  }

  /** The index of ten minutes. `page`: their number since 1970. */
  index(page: number): Promise<void> {
    if (this.stateOf(`index ${page}`) === 'ready') return Promise.resolve();
    return this.#load(`index ${page}`, () => this.source.loadIndex(spanOf(page)));
  }

  /** The first poses of ten minutes; `coarse`: one of each minute. */
  keys(page: number, coarse = false): Promise<void> {
    const name = `${coarse ? 'some' : ''}keys ${page}`;
    if (this.stateOf(name) === 'ready' || this.stateOf(`keys ${page}`) === 'ready') return Promise.resolve();
    return this.#load(name, () => this.source.loadKeys(spanOf(page), coarse ? COARSE_MS : 0));
  }

  /** The per-minute data of the day (UTC) of a moment. */
  day(atMs: number): Promise<void> {
    const fromMs = atMs - (atMs % DAY_MS);
    return this.#load(nameOfDay(atMs), async () => this.source.loadDays?.({ fromMs, toMs: fromMs }));
  }

  /** A schema's reader, if loaded. */
  knownReader(sha256: string): SchemaReader | null {
    return this.#known.get(sha256) ?? null;
  }

  reader(sha256: string): Promise<SchemaReader> {
    const known = this.#readers.get(sha256);
    if (known !== undefined) return known;
    const made = this.source.schema(sha256).then((schema) => {
      const reader = readerOf(schema);
      this.#known.set(sha256, reader);
      return reader;
    });
    this.#readers.set(sha256, made);
    made.catch(() => this.#readers.delete(sha256));
    dropOldest(this.#readers, SCHEMAS_MAX);
    dropOldest(this.#known, SCHEMAS_MAX);
    return made;
  }

  /** Cancels the loading of all segments except these. */
  keepOnly(refs: readonly SegmentRef[]): void {
    const kept = new Set(refs.map(nameOfRef));
    for (const [name, load] of this.#loads) {
      if (!name.includes('/') || kept.has(name)) continue;
      if (load.state === 'loading' || load.state === 'away') {
        load.abort.abort();
        this.#loads.delete(name);
      }
    }
  }

  #load(name: string, run: (signal: AbortSignal) => Promise<void>): Promise<void> {
    const before = this.#loads.get(name);
    const nowMs = this.nowMs();
    if (before !== undefined && (before.state === 'loading' || before.retryMs > nowMs)) return before.promise;
    const state = before?.state === 'away' ? 'away' : 'loading'; // still away as far as is known
    const abort = new AbortController();
    const begunMs = before?.state === 'away' ? before.begunMs : nowMs;
    const load: Load = {
      state,
      begunMs,
      retryMs: Number.POSITIVE_INFINITY,
      abort,
      promise: Promise.resolve(),
    };
    this.#loads.set(name, load);
    load.promise = run(abort.signal).then(
      () => {
        if (abort.signal.aborted) return;
        load.state = 'ready';
        // it is on the tape; otherwise the source reports that it no longer has it
        if (name.includes('/') || name.startsWith('day')) this.#loads.delete(name);
        this.onChange();
      },
      (error: unknown) => {
        if (abort.signal.aborted) return;
        load.state = error instanceof PastError ? error.why : 'damaged';
        if (load.state === 'away') load.retryMs = this.nowMs() + RETRY_MS;
        this.onChange();
      },
    );
    return load.promise;
  }
}

/** The name of a moment's day. */
export function nameOfDay(atMs: number): string {
  return `day ${Math.floor(atMs / DAY_MS)}`;
}

function spanOf(page: number): Span {
  return { fromMs: page * PAGE_MS, toMs: (page + 1) * PAGE_MS - 1 }; // a span includes its end, and so the page of its end
}
