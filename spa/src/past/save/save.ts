/** Saves a span of a robot's past as one file: a separate chunk, loaded only for saving. */
import type { SegmentRef } from '../past_source.ts';
import type { Span } from '../past_types.ts';
import { writeCsv } from './csv_file.ts';
import { writePosecast } from './posecast_file.ts';
import {
  findSegments,
  type Lost,
  loadSpan,
  type SavedSpan,
  SaveError,
  type SaveFormat,
  type SavePorts,
} from './saved_span.ts';

/** For a recording: the overhead of a segment, consisting of its first pose, its index row and its name. */
const SEGMENT_BYTES = 800;

/** What there is to save in a span, before it is fetched. */
export interface Measure {
  readonly frames: number;
  /** The approximate size of the file. */
  readonly bytes: number;
  /** The end of the newest segment, unix ms: later data is in no segment yet. */
  readonly untilMs: number;
}

type Ports = Pick<SavePorts, 'source' | 'models' | 'breathe' | 'signal'>;

/** Estimates the result of saving a span from one of its segments. Rejects with a `SaveError`, or with the reason of the
 *  signal. */
export async function measureSpan(format: SaveFormat, span: Span, ports: Ports): Promise<Measure> {
  const { source, signal } = ports;
  const refs = await findSegments(source, span);
  const untilMs = Math.max(...refs.map(({ toMs }) => toMs));
  const counts = refs.map((ref) => Math.round(ref.frames * shareOf(ref, span)));
  const frames = counts.reduce((sum, count) => sum + count, 0);
  if (format === 'posecast') {
    const sum = refs.reduce((bytes, ref) => bytes + ref.bytes + SEGMENT_BYTES, 0);
    return { frames, bytes: sum + (await modelBytes(refs, ports)), untilMs };
  }
  let bytes = 0;
  const sizes = new Map<string, number>();
  for (const [i, ref] of refs.entries()) {
    signal.throwIfAborted();
    if (counts[i] === 0) continue;
    const kind = `${ref.schema} ${ref.model}`;
    const size = sizes.get(kind) ?? (await bytesOfFrame(format, ref, ports));
    sizes.set(kind, size);
    bytes += counts[i]! * size;
  }
  return { frames, bytes, untilMs };
}

/** The fraction of a segment that lies in a span. */
function shareOf({ fromMs, toMs }: SegmentRef, span: Span): number {
  const withinMs = Math.min(toMs, span.toMs) - Math.max(fromMs, span.fromMs);
  return toMs > fromMs ? Math.min(1, Math.max(0, withinMs / (toMs - fromMs))) : 1;
}

/** The size of one frame of a segment; 0 if unavailable. */
async function bytesOfFrame(format: SaveFormat, ref: SegmentRef, ports: Ports): Promise<number> {
  const source = { ...ports.source, loadIndex: async () => {}, segmentsIn: () => [ref] };
  try {
    const loaded = await loadSpan({ ...ports, source }, ref, () => {});
    const { blob } = await writeSpan(format, loaded, ports, () => {});
    return blob.size / ref.frames;
  } catch (error) {
    if (error instanceof SaveError) return 0;
    throw error;
  }
}

async function modelBytes(refs: readonly SegmentRef[], { models }: Ports): Promise<number> {
  let sum = 0;
  for (const model of new Set(refs.flatMap((ref) => ref.model ?? []))) {
    const files = await models.files(model).catch(() => []);
    for (const { bytes } of files) sum += bytes;
  }
  return sum;
}

export { SaveError } from './saved_span.ts';

/** The share of the work that is done once all segments are loaded. */
const LOADED = 0.5;

export interface SavedFile {
  readonly blob: Blob;
  readonly name: string;
  readonly lost: Lost;
}

/** Saves a span, including its ends, unix ms. Rejects with a `SaveError`, or with the reason of the signal. */
export async function saveSpan(format: SaveFormat, span: Span, ports: SavePorts): Promise<SavedFile> {
  const { onProgress } = ports;
  const whole = { fromMs: Math.floor(span.fromMs), toMs: Math.floor(span.toMs) };
  const loaded = await loadSpan(ports, whole, (part) => onProgress(LOADED * part));
  const { blob, lostModels } = await writeSpan(format, loaded, ports, (part) =>
    onProgress(LOADED + (1 - LOADED) * part),
  );
  const { robot } = loaded.segments[0]!.segment.start;
  const lost = { segments: loaded.lostSegments, models: lostModels };
  return { blob, name: fileName(robot, whole.fromMs, format), lost };
}

/** `demo_2026-11-22_14-02-07.csv`, in the viewer's time zone, like all moments on the page. */
export function fileName(robot: string, fromMs: number, format: SaveFormat): string {
  const at = new Date(fromMs);
  const two = (part: number) => String(part).padStart(2, '0');
  const day = [at.getFullYear(), two(at.getMonth() + 1), two(at.getDate())].join('-');
  const time = [at.getHours(), at.getMinutes(), at.getSeconds()].map(two).join('-');
  return `${robot}_${day}_${time}.${format}`;
}

/** Writes a span as a file. `onPart` receives the progress, 0…1; `lostModels`: how many models were unavailable. Rejects with the
 *  reason of the signal. */
function writeSpan(
  format: SaveFormat,
  span: SavedSpan,
  ports: Pick<SavePorts, 'models' | 'breathe' | 'signal'>,
  onPart: (part: number) => void,
): Promise<{ readonly blob: Blob; readonly lostModels: number }> {
  switch (format) {
    case 'csv':
      return writeCsv(span, ports, onPart);
    case 'posecast':
      return writePosecast(span, ports, onPart);
  }
}
