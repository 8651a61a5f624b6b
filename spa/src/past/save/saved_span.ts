import {
  Decoder,
  decodeSegment,
  FrameError,
  type MergedFrame,
  mergeSegments,
  type Schema,
  type Segment,
  SegmentError,
} from '@posecast/wire';
import { PastError, type SegmentRef } from '../past_source.ts';
import type { Span } from '../past_types.ts';
import { SaveError, type SavePorts, SEGMENTS_BYTES_MAX, SPAN_MS_MAX } from './save_ports.ts';

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
  const waiting = [...refs.entries()];
  const work = async () => {
    for (let next = waiting.shift(); next !== undefined; next = waiting.shift()) {
      const [place, ref] = next;
      signal.throwIfAborted();
      try {
        found[place] = await load(source, ref, schemas, signal);
      } catch (error) {
        if (!(error instanceof PastError || error instanceof SegmentError)) throw error;
        isAway ||= error instanceof PastError && error.why === 'away';
      }
      onPart(++done / refs.length);
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, work));
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

interface SchemaReader {
  readonly schema: Schema;
  readonly decoder: Decoder;
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

function readerOf({ text }: Schema): SchemaReader {
  const decoder = new Decoder(1);
  return { schema: decoder.addSchema(text), decoder };
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
