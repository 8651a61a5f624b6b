import { decodeSegment, type Schema, type Segment, SegmentError } from '@posecast/wire';
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
