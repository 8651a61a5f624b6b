import {
  type Decoder,
  decodeSegment,
  FrameError,
  type MergedFrame,
  mergeSegments,
  type Schema,
  type Segment,
  SegmentError,
} from '@posecast/wire';
import { eachOf } from '../../kit.ts';
import type { Manifest } from '../../model/manifest.ts';
import { PastError, type PastSource, type SegmentRef } from '../past_source.ts';
import type { Span } from '../past_types.ts';
import { readerOf, type SchemaReader } from '../player/tape/tape.ts';

/** The number of segments fetched in parallel. */
const AT_ONCE = 4;

/** A segment with its recorded bytes. */
export interface SavedSegment {
  readonly ref: SegmentRef;
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly segment: Segment;
}

/** The content of a span: all segments that overlap it, by start, and their schemas. */
export interface SavedSpan extends Span {
  readonly segments: readonly SavedSegment[];
  readonly schemas: ReadonlyMap<string, Schema>;
  readonly lostSegments: number;
}

/** The segments that overlap a span. Rejects with a `SaveError`. */
export async function findSegments(source: SavePorts['source'], span: Span): Promise<readonly SegmentRef[]> {
  if (span.toMs - span.fromMs > SPAN_MS_MAX) throw new SaveError('too-long');
  try {
    await source.loadIndex(span);
  } catch (error) {
    if (!(error instanceof PastError)) throw error;
    throw new SaveError(error.why === 'away' ? 'away' : 'nothing');
  }
  const refs = source.segmentsIn(span);
  if (refs.length === 0) throw new SaveError('nothing');
  if (refs.reduce((sum, { bytes }) => sum + bytes, 0) > SEGMENTS_BYTES_MAX) throw new SaveError('too-long');
  return refs;
}

/** Fetches the segments in a span. `onPart` receives the progress, 0…1. Unavailable segments are left out and counted. Rejects
 *  with a `SaveError`, or with the reason of the signal. */
export async function loadSpan(
  { source, signal }: Pick<SavePorts, 'source' | 'signal'>,
  span: Span,
  onPart: (part: number) => void,
): Promise<SavedSpan> {
  const refs = await findSegments(source, span);
  const found = new Array<SavedSegment | null>(refs.length).fill(null);
  const schemas = new Map<string, Schema>();
  let isAway = false;
  let done = 0;
  await eachOf(refs.entries(), AT_ONCE, async ([place, ref]) => {
    signal.throwIfAborted();
    try {
      found[place] = await load(source, ref, schemas, signal);
    } catch (error) {
      if (!(error instanceof PastError || error instanceof SegmentError)) throw error;
      isAway ||= error instanceof PastError && error.why === 'away';
    }
    onPart(++done / refs.length);
  });
  const segments = found.filter((each) => each !== null);
  if (segments.length === 0) throw new SaveError(isAway ? 'away' : 'nothing');
  return { ...span, segments, schemas, lostSegments: refs.length - segments.length };
}

async function load(
  source: SavePorts['source'],
  ref: SegmentRef,
  schemas: Map<string, Schema>,
  signal: AbortSignal,
): Promise<SavedSegment> {
  const bytes = await source.segmentBytes(ref, signal);
  const segment = decodeSegment(bytes);
  const { take, index, schema } = segment.start;
  if (take !== ref.take || index !== ref.index) throw new PastError('damaged', 'another segment');
  if (schema !== null && !schemas.has(schema)) schemas.set(schema, await source.schema(schema));
  return { ref, bytes, segment };
}

/** A frame in the span. `atUs`: when the relay accepted it, unix. */
export interface SavedFrame {
  readonly schema: Schema;
  readonly atUs: number;
  /** Robot time, seconds. */
  readonly tS: number;
  readonly codes: Int32Array;
}

/** The frames accepted in a span, each once: within a run by number, between runs by time. Undecodable frames are skipped, as in
 *  live. `onPart` receives the progress, 0…1. */
export function* framesOf(span: SavedSpan, onPart: (part: number) => void = () => {}): Generator<SavedFrame> {
  const { frames } = mergeSegments(span.segments.map(({ segment }) => segment));
  const heads = runsOf(frames).map((run) => ({ run, at: 0, decoders: new Map<string, SchemaReader>() }));
  for (let done = 0; done < frames.length; ) {
    const [first] = heads.filter(({ run, at }) => at < run.length).sort((a, b) => headMs(a) - headMs(b));
    const { run, at, decoders } = first!;
    const { schema: sha256, atMs, copies, frame } = run[at]!;
    first!.at += 1;
    onPart(++done / frames.length);
    const reader = decoders.get(sha256) ?? readerOf(span.schemas.get(sha256)!);
    decoders.set(sha256, reader);
    const decoded = decode(reader.decoder, [...copies, frame]);
    const atUs = Math.round(atMs * 1000);
    if (decoded === null || !isWithin(span, atUs)) continue;
    yield { schema: reader.schema, atUs, tS: decoded.tS, codes: decoded.codes };
  }
}

/** The robot's model over time: unix µs and the manifest's hash, oldest first. */
export function modelsOf({
  segments,
}: SavedSpan): { readonly atUs: number; readonly model: string | null }[] {
  const found: { atUs: number; model: string | null }[] = [];
  for (const { segment } of segments) {
    const { start, records } = segment;
    found.push({ atUs: start.fromMs * 1000, model: start.model });
    for (const record of records)
      if (record.kind === 'model')
        found.push({ atUs: start.fromMs * 1000 + record.atUs, model: record.model });
  }
  return found.sort((a, b) => a.atUs - b.atUs);
}

function runsOf(frames: readonly MergedFrame[]): MergedFrame[][] {
  const runs = new Map<string, MergedFrame[]>();
  for (const frame of frames) {
    const run = runs.get(frame.runId) ?? [];
    runs.set(frame.runId, run);
    run.push(frame);
  }
  return [...runs.values()];
}

function headMs({ run, at }: { readonly run: readonly MergedFrame[]; readonly at: number }): number {
  return run[at]!.atMs;
}

/** Whether a moment (unix µs) lies in a span, including its ends. */
function isWithin({ fromMs, toMs }: SavedSpan, atUs: number): boolean {
  return atUs >= fromMs * 1000 && atUs <= toMs * 1000 + 999;
}

/** The content of the last of some frames; null if it can't be decoded. */
function decode(decoder: Decoder, frames: readonly Uint8Array[]) {
  try {
    return frames.map((frame) => decoder.decode(frame)).at(-1)!;
  } catch (error) {
    if (error instanceof FrameError) return null;
    throw error;
  }
}

/** How many bytes are held in the page's memory; Blobs belong to the browser, which moves large ones to disk. */
const PART_BYTES = 4 << 20;

/** Builds a file: about `PART_BYTES` at a time are held here, the rest in Blobs. */
export class BlobParts {
  readonly #blobs: Blob[] = [];
  #pieces: BlobPart[] = [];
  #held = 0;

  /** Adds a copy of bytes, or text as UTF-8. */
  write(piece: Uint8Array | string): void {
    const bytes = typeof piece === 'string' ? new TextEncoder().encode(piece) : piece.slice();
    if (bytes.length === 0) return;
    this.#pieces.push(bytes as Uint8Array<ArrayBuffer>);
    this.#held += bytes.length;
    if (this.#held < PART_BYTES) return;
    this.#blobs.push(new Blob(this.#pieces));
    this.#pieces = [];
    this.#held = 0;
  }

  /** The whole file. */
  blob(type: string): Blob {
    return new Blob([...this.#blobs, ...this.#pieces], { type });
  }
}

/** The longest span that can be saved, ms. */
export const SPAN_MS_MAX = 600_000;
/** Size limit of a span's segments, which are held in memory while saving: ten times the size of ten minutes of the demo
 *  robot. */
export const SEGMENTS_BYTES_MAX = 64e6;

export type SaveFormat = 'csv' | 'posecast';

/** A file of a model: its path beside the manifest (`manifest.json` is one of them), and the function that fetches it. */
export interface ModelFile {
  readonly path: string;
  /** From the manifest; 0 for the manifest itself. */
  readonly bytes: number;
  /** Rejects with an Error whose message is one line. */
  fetch(): Promise<Uint8Array>;
}

/** The source of models. All methods reject with an Error whose message is one line. */
export interface SavedModels {
  /** The manifest of a model; null if the model has no such data. */
  manifest(sha256: string): Promise<Manifest | null>;
  /** All files of a model, the manifest first. */
  files(sha256: string): Promise<readonly ModelFile[]>;
}

/** What saving needs from the page. */
export interface SavePorts {
  readonly source: Pick<PastSource, 'loadIndex' | 'segmentsIn' | 'segmentBytes' | 'schema'>;
  readonly models: SavedModels;
  /** Lets the page draw and respond. */
  readonly breathe: () => Promise<void>;
  readonly signal: AbortSignal;
  /** The progress, 0…1. */
  readonly onProgress: (part: number) => void;
}

/** What is missing in a saved file because it was unavailable. */
export interface Lost {
  readonly segments: number;
  readonly models: number;
}

/** Why nothing was saved. `nothing`: nothing is recorded in the span, or none of it was available. `too-long`: more than
 *  `SPAN_MS_MAX` or `SEGMENTS_BYTES_MAX`. `away`: the source does not answer. */
export class SaveError extends Error {
  override readonly name = 'SaveError';

  constructor(readonly why: 'nothing' | 'too-long' | 'away') {
    super(`not saved: ${why}`);
  }
}
