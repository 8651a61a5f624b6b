import {
  Decoder,
  FrameError,
  parseRelayMessage,
  type Schema,
  type Segment,
  type SegmentRecord,
} from '@posecast/wire';
import { firstPlace } from '../../../kit.ts';
import { nameOfRef, type SegmentRef } from '../../past_source.ts';
import type { PastState, Span } from '../../past_types.ts';
import { type Happening, type Situation, situationAfter } from './happenings.ts';

/** Size limit of loaded segments: their bytes and the codes of their frames. Segments farthest from the playhead are dropped
 *  first. If a single segment exceeds the limit, only every n-th frame is read. */
export const TAPE_BYTES_MAX = 16e6;

/** A frame with the run that its number belongs to. */
export interface TapeFrame extends PastState {
  readonly runId: string;
  readonly schema: Schema;
}

/** A schema with the decoder of its frames. Segments share no base frames, so one decoder serves all of them in turn. */
export interface SchemaReader {
  readonly schema: Schema;
  readonly decoder: Decoder;
}

export function readerOf({ text }: Schema): SchemaReader {
  const decoder = new Decoder(1);
  return { schema: decoder.addSchema(text), decoder };
}

/** A fetched segment. It is decoded once, when it is first needed. */
export class TapePart {
  #frames: TapeFrame[] | null = null;
  #happenings: Happening[] = [];
  #segment: Segment | null;
  readonly #recordBytes: number;

  /** `reader`: null for a segment without frames. */
  constructor(
    readonly ref: SegmentRef,
    segment: Segment,
    readonly reader: SchemaReader | null,
  ) {
    this.#segment = segment;
    this.#recordBytes = segment.records.reduce((sum, record) => sum + sizeOf(record), 0);
  }

  get isOpen(): boolean {
    return this.#frames !== null;
  }

  get bytes(): number {
    // an index may say anything
    return (
      Math.max(this.ref.bytes, this.#recordBytes) +
      4 * (this.#frames?.length ?? 0) * (this.reader?.schema.size ?? 0)
    );
  }

  /** In order; undecodable frames are skipped, as in live. */
  get frames(): readonly TapeFrame[] {
    return this.#frames ?? this.#read(this.#segment!);
  }

  /** In order; the first is the segment's start. */
  get happenings(): readonly Happening[] {
    if (this.#frames === null) this.#read(this.#segment!);
    return this.#happenings;
  }

  situationAt(momentMs: number): Situation {
    const [first, ...later] = this.happenings as readonly [Happening & { kind: 'start' }, ...Happening[]];
    return situationAfter(
      first.start,
      later.filter(({ atMs }) => atMs <= momentMs),
    );
  }

  #read({ start, records }: Segment): readonly TapeFrame[] {
    const { fromMs, runId, model, info, word, openFaults } = start;
    const frames: TapeFrame[] = [];
    const faults = openFaults.map(parseRelayMessage).filter((event) => event?.type === 'event');
    const first = { model, info, word, faults };
    const happenings: Happening[] = [{ kind: 'start', start: first, atMs: fromMs, place: 0 }];
    const { schema, decoder } = this.reader ?? {};
    const count = records.filter(({ kind }) => kind === 'frame').length;
    const every = Math.ceil((4 * count * (schema?.size ?? 0)) / TAPE_BYTES_MAX);
    let nth = 0;
    for (const record of records) {
      const at = { atMs: fromMs + record.atUs / 1000, place: frames.length };
      if (record.kind === 'frame' || record.kind === 'copy') {
        if (schema === undefined || decoder === undefined) continue;
        try {
          const { seq, tS, codes } = decoder.decode(record.frame);
          if (record.kind === 'copy' || nth++ % every > 0) continue;
          const { atMs } = at;
          frames.push({
            ...{ runId, schema, schemaId: schema.id, seq, tS, codes, atMs },
            lateMs: record.lateUs / 1000,
          });
        } catch (error) {
          if (!(error instanceof FrameError)) throw error;
        }
      } else if (record.kind === 'event') {
        const event = parseRelayMessage(record.text);
        if (event?.type === 'event') happenings.push({ kind: 'event', event, ...at });
      } else happenings.push({ ...record, ...at });
    }
    this.#segment = null;
    this.#happenings = happenings;
    this.#frames = frames;
    return frames;
  }
}

/** About the size of a record, bytes. */
function sizeOf(record: SegmentRecord): number {
  if ('frame' in record) return record.frame.length;
  if ('text' in record) return record.text.length;
  return 'info' in record ? [...record.info].reduce((sum, pair) => sum + pair.join('').length, 0) : 0;
}

/** The fetched segments, and the order of frames across runs and takes. */
export class Tape {
  readonly #parts = new Map<string, TapePart>();
  /** When each run was first seen, unix ms. */
  readonly #beginsMs = new Map<string, number>();

  get(ref: SegmentRef): TapePart | null {
    return this.#parts.get(nameOfRef(ref)) ?? null;
  }

  get bytes(): number {
    let sum = 0;
    for (const { bytes } of this.#parts.values()) sum += bytes;
    return sum;
  }

  add(part: TapePart): void {
    this.#parts.set(nameOfRef(part.ref), part);
  }

  /** Drops the segments that overlap these spans. */
  forget(spans: readonly Span[]): void {
    const isIn = ({ ref }: TapePart) =>
      spans.some(({ fromMs, toMs }) => ref.fromMs < toMs && ref.toMs > fromMs);
    for (const [name, part] of this.#parts) if (isIn(part)) this.#parts.delete(name);
  }

  /** Enforces the size limit. `momentMs`: the position of the playhead. */
  trim(momentMs: number): void {
    let { bytes } = this;
    if (bytes <= TAPE_BYTES_MAX) return;
    const far = [...this.#parts].sort(([, a], [, b]) => farFrom(b, momentMs) - farFrom(a, momentMs));
    for (const [name, part] of far.slice(0, -1)) {
      if (bytes <= TAPE_BYTES_MAX) return;
      this.#parts.delete(name);
      bytes -= part.bytes;
    }
  }

  /** Records that a run existed at a moment. */
  learnRun(runId: string, atMs: number): void {
    const known = this.#beginsMs.get(runId);
    if (known === undefined || atMs < known) this.#beginsMs.set(runId, atMs);
  }

  /** Positive: `a` comes after `b`; 0: they are the same frame. Within a run the frame numbers decide, with wrap-around. */
  order(a: TapeFrame, b: TapeFrame): number {
    if (a.runId === b.runId) return (a.seq - b.seq) | 0;
    const [begunA, begunB] = [this.#beginsMs.get(a.runId), this.#beginsMs.get(b.runId)];
    const apartMs = begunA === undefined || begunB === undefined ? 0 : begunA - begunB;
    return apartMs || a.atMs - b.atMs || (a.runId < b.runId ? -1 : 1);
  }

  /** The later of two frames. */
  last(a: TapeFrame | null, b: TapeFrame | null): TapeFrame | null {
    if (a === null || b === null) return a ?? b;
    return this.order(a, b) >= 0 ? a : b;
  }
}

/** The newest at or before a moment. */
export function newestAt<T extends { readonly atMs: number }>(
  list: readonly T[],
  momentMs: number,
): T | null {
  return list[firstPlace(list, ({ atMs }) => atMs > momentMs) - 1] ?? null;
}

function farFrom({ ref }: TapePart, momentMs: number): number {
  return Math.max(ref.fromMs - momentMs, momentMs - ref.toMs);
}
