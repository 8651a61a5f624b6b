import {
  encodeKeyPage,
  encodeRecording,
  keyPagePath,
  modelPath,
  type PastRecording,
  RECORDING_FILE,
  type RecordedEvent,
  type RecordedSegment,
  type RecordedWord,
  type Segment,
  segmentPath,
} from '@posecast/wire';
import { Zip, ZipDeflate, ZipPassThrough } from 'fflate';
import { PAGE_MS } from '../past_types.ts';
import { BlobParts, modelsOf, type SavedSegment, type SavedSpan, type SavePorts } from './saved_span.ts';

/** Target size of a page of KEYs; if there are too many, it has every n-th. */
const KEYS_BYTES_WANTED = 100_000;
const EVERY_MAX = 1024;

/** Writes the segments in a span byte for byte, with everything needed to play them, as a single-file recording (SPEC §12).
 *  `lostModels`: how many models are missing or incomplete. */
export async function writePosecast(
  span: SavedSpan,
  ports: Pick<SavePorts, 'models' | 'breathe' | 'signal'>,
  onPart: (part: number) => void,
): Promise<{ readonly blob: Blob; readonly lostModels: number }> {
  const file = new BlobParts();
  const zip = new ZipFile(file);
  const models = [...new Set(modelsOf(span).flatMap(({ model }) => model ?? []))];
  let lostModels = 0;
  for (const [i, model] of models.entries()) {
    const isWhole = await addModel(zip, model, ports, (part) => onPart((i + part) / models.length / 2));
    if (!isWhole) lostModels += 1;
  }
  for (const { ref, bytes } of span.segments) {
    zip.add(segmentPath(ref), bytes, 'stored');
    await ports.breathe();
    ports.signal.throwIfAborted();
  }
  for (const [path, page] of keyPagesOf(span.segments)) {
    zip.add(path, page, 'stored');
    await ports.breathe();
  }
  zip.add(RECORDING_FILE, encodeRecording(recordingOf(span, models)), 'deflated');
  zip.end();
  onPart(1);
  return { blob: file.blob('application/zip'), lostModels };
}

/** The `recording.json` of a span. It begins with its first segment and ends with its last. */
function recordingOf({ segments, schemas }: SavedSpan, models: readonly string[]): PastRecording {
  const { robot, view } = segments[0]!.segment.start;
  const begins = segments.map(({ segment }) => segment.start.fromMs);
  const ends = segments.map(({ segment }) => segment.toMs);
  return {
    ...{ robot, view, title: null, author: null, licence: null, notes: [] },
    fromMs: Math.min(...begins),
    toMs: Math.max(...ends),
    schemas: new Map([...schemas].map(([sha256, { text }]) => [sha256, text])),
    models,
    segments: segments.map(recordedOf),
  };
}

function recordedOf({ bytes, segment }: SavedSegment): RecordedSegment {
  const { start, toMs, records } = segment;
  const { take, runId, index, fromMs, schema, model, missing } = start;
  const frames = records.filter((record) => record.kind === 'frame');
  return {
    ...{ take, runId, index, fromMs, toMs, schema, model, missing, bytes: bytes.length },
    frames: frames.length,
    firstSeq: frames[0]?.seq ?? 0,
    lastSeq: frames.at(-1)?.seq ?? 0,
    words: wordsOf(segment),
    events: eventsOf(segment),
  };
}

function wordsOf({ start, records }: Segment): RecordedWord[] {
  const words: RecordedWord[] = [{ atMs: start.fromMs, word: start.word }];
  for (const record of records)
    if (record.kind === 'word') words.push({ atMs: momentOf(start.fromMs, record.atUs), word: record.word });
  return words;
}

function eventsOf({ start, records }: Segment): RecordedEvent[] {
  return records.flatMap((record) => {
    if (record.kind !== 'event') return [];
    const event = objectIn(record.text);
    return event === null ? [] : [{ atMs: momentOf(start.fromMs, record.atUs), event }];
  });
}

function momentOf(fromMs: number, atUs: number): number {
  return fromMs + Math.floor(atUs / 1000);
}

function objectIn(text: string): Readonly<Record<string, unknown>> | null {
  try {
    const value: unknown = JSON.parse(text);
    return typeof value === 'object' && value !== null && !Array.isArray(value)
      ? (value as Record<string, unknown>)
      : null;
  } catch {
    return null;
  }
}

/** One page of KEYs for each ten minutes that have any, with its path. */
function* keyPagesOf(
  segments: readonly SavedSegment[],
): Generator<readonly [path: string, page: Uint8Array]> {
  const { robot, view } = segments[0]!.segment.start;
  const pages = new Map<number, Segment[]>();
  for (const { segment } of segments) {
    const fromMs = segment.start.fromMs - (segment.start.fromMs % PAGE_MS);
    if (!segment.records.some(({ kind }) => kind === 'frame')) continue;
    pages.set(fromMs, [...(pages.get(fromMs) ?? []), segment]);
  }
  for (const [fromMs, within] of pages) {
    const header = { robot, view, fromMs };
    let every = 1;
    let page = encodeKeyPage(header, within);
    while (page.length > KEYS_BYTES_WANTED && every < EVERY_MAX) {
      every *= 2;
      page = encodeKeyPage(header, within, every);
    }
    yield [keyPagePath(fromMs), page];
  }
}

/** Adds the files of a model. False if some of them were unavailable. */
async function addModel(
  zip: ZipFile,
  model: string,
  { models, breathe, signal }: Pick<SavePorts, 'models' | 'breathe' | 'signal'>,
  onPart: (part: number) => void,
): Promise<boolean> {
  let isWhole = true;
  const files = await models.files(model).catch(() => null);
  if (files === null) return false;
  for (const [i, { path, fetch }] of files.entries()) {
    signal.throwIfAborted();
    const bytes = await fetch().catch(() => null);
    if (bytes === null) isWhole = false;
    else zip.add(modelPath(model, path), bytes, path.endsWith('.json') ? 'deflated' : 'stored');
    onPart((i + 1) / files.length);
    await breathe();
  }
  signal.throwIfAborted();
  return isWhole;
}

/** Writes a ZIP file, one entry at a time. */
class ZipFile {
  readonly #zip: Zip;

  constructor(file: BlobParts) {
    this.#zip = new Zip((error, bytes) => {
      if (error) throw error;
      file.write(bytes);
    });
  }

  add(path: string, bytes: Uint8Array, how: 'stored' | 'deflated'): void {
    const entry = how === 'stored' ? new ZipPassThrough(path) : new ZipDeflate(path, { level: 6 });
    this.#zip.add(entry);
    entry.push(bytes, true);
  }

  end(): void {
    this.#zip.end();
  }
}
