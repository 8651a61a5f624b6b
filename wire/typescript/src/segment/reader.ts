/** Reads segments. What breaks a rule of SPEC §10 is refused whole, with one line that says what and where. */

import { FRAME_BYTES_MAX } from '../frame.ts';
import type { RobotStatus } from '../messages.ts';
import { type ByteReader, hexOf } from './byte_reader.ts';
import { openEnvelope } from './envelope.ts';
import { FrameChain } from './frame_chain.ts';
import {
  DURATION_MS_MAX,
  EVENT_BYTES_MAX,
  FROM_MS_MAX,
  HASH_BYTES,
  INFO_BYTES_MAX,
  KINDS,
  NAME,
  NAME_BYTES_MAX,
  NUMBERING_BYTES_MAX,
  OPEN_FAULTS_MAX,
  refuse,
  SEGMENT,
  type Segment,
  SegmentError,
  type SegmentRecord,
  type SegmentStart,
  U32_MAX,
  WORDS,
} from './segment.ts';

interface Header {
  readonly start: SegmentStart;
  readonly durationMs: number;
  readonly frames: number;
  readonly firstSeq: number;
  readonly lastSeq: number;
}

/** Decodes a segment; frames are parts of `data`. Records of unknown kinds are skipped. SegmentError when it is
 *  none. */
export function decodeSegment(data: Uint8Array): Segment {
  const envelope = openEnvelope(data, SEGMENT);
  const header = readHeader(envelope.header);
  const chain = new FrameChain();
  const records = [...readRecords(envelope.records, envelope.count, header.durationMs, chain)];
  checkFrames(header, chain);
  return { start: header.start, toMs: header.start.fromMs + header.durationMs, records };
}

/** The start of a segment, and its records up to and including the first frame; all of them if there is no frame. Of the
 *  rest only the checksum is checked. Throws SegmentError. */
export function readUntilFrame(data: Uint8Array): Pick<Segment, 'start' | 'records'> {
  const envelope = openEnvelope(data, SEGMENT);
  const { start, durationMs } = readHeader(envelope.header);
  const records: SegmentRecord[] = [];
  for (const record of readRecords(envelope.records, envelope.count, durationMs, new FrameChain())) {
    records.push(record);
    if (record.kind === 'frame') break;
  }
  return { start, records };
}

function readHeader(r: ByteReader): Header {
  const robot = readName(r, 'robot');
  const view = readName(r, 'view');
  const take = r.u64('take');
  const index = r.varint('index', U32_MAX);
  const runId = r.u64('run');
  const fromMs = r.varint('from', FROM_MS_MAX);
  const durationMs = r.varint('duration', DURATION_MS_MAX);
  const frames = r.varint('frames');
  const firstSeq = r.varint('first seq', U32_MAX);
  const lastSeq = r.varint('last seq', U32_MAX);
  const schema = r.hash('schema');
  const model = r.hash('model');
  const word = readWord(r);
  const missing = r.varint('missing', U32_MAX);
  const numbering = r.text('numbering', NUMBERING_BYTES_MAX);
  const eventN = r.varint('event n');
  const info = r.info('info', INFO_BYTES_MAX);
  const openFaults = Array.from({ length: r.varint('open faults', OPEN_FAULTS_MAX) }, () =>
    r.text('open fault', EVENT_BYTES_MAX),
  );
  if (frames > 0 && (schema === null || /^0+$/.test(runId)))
    r.fail('header', 'frames without a schema or run');
  const [named, described] = [
    { robot, view, take, index, runId, fromMs, schema, model },
    { word, missing, numbering, eventN, info, openFaults },
  ];
  return { start: { ...named, ...described }, durationMs, frames, firstSeq, lastSeq };
}

export function readName(r: ByteReader, what: string): string {
  const { at } = r;
  const name = r.text(what, NAME_BYTES_MAX);
  if (!NAME.test(name)) refuse(`byte ${at}`, `${what}: no name`);
  return name;
}

function readWord(r: ByteReader): RobotStatus {
  const { at } = r;
  const word = r.byte('word');
  return WORDS[word] ?? refuse(`byte ${at}`, `word: ${word} is none`);
}

function* readRecords(
  r: ByteReader,
  count: number,
  durationMs: number,
  chain: FrameChain,
): Generator<SegmentRecord> {
  const { end } = r;
  let found = 0;
  let atUs = 0;
  while (r.at < end) {
    const start = r.at;
    const kind = r.byte('kind');
    atUs += r.varint('wait', (DURATION_MS_MAX + 1) * 1000);
    const size = r.varint('length', end - r.at);
    if (size > end - r.at) r.fail('length', `${size} bytes said, ${end - r.at} left`);
    if (kind === 0) refuse(`byte ${start}`, 'an end before the end');
    if (atUs > durationMs * 1000 + 999) refuse(`byte ${start}`, `a record at ${atUs} µs of ${durationMs} ms`);
    found++;
    r.end = r.at + size;
    const record = readRecord(r, kind, atUs, chain);
    if (record !== null) yield record;
    r.at = r.end;
    r.end = end;
  }
  if (found !== count) refuse(`byte ${end}`, `${found} records, ${count} said`);
}

/** The record with its content from `r.at` to `r.end`; null if its kind is unknown. */
function readRecord(r: ByteReader, kind: number, atUs: number, chain: FrameChain): SegmentRecord | null {
  const name = KINDS[kind];
  if (name === undefined) return null;
  const record = readKnown(r, name, atUs, chain);
  if (r.at !== r.end) r.fail(name, `${r.end - r.at} bytes too many`);
  return record;
}

function readKnown(
  r: ByteReader,
  kind: (typeof KINDS)[number],
  atUs: number,
  chain: FrameChain,
): SegmentRecord | null {
  const start = r.at;
  const size = r.end - start;
  switch (kind) {
    case 'frame': {
      const lateUs = r.varint('lateness');
      const frame = r.bytes('frame', checked(r, 'frame', r.end - r.at, FRAME_BYTES_MAX));
      return { kind, atUs, lateUs, seq: placed(start, () => chain.addFrame(frame)), frame };
    }
    case 'copy': {
      const frame = r.bytes('copy', checked(r, 'copy', size, FRAME_BYTES_MAX));
      placed(start, () => chain.addCopy(frame));
      return { kind, atUs, frame };
    }
    case 'event':
      return { kind, atUs, text: r.utf8('event', checked(r, 'event', size, EVENT_BYTES_MAX)) };
    case 'info':
      return { kind, atUs, info: r.info('info', INFO_BYTES_MAX) };
    case 'model':
      if (size !== 0 && size !== HASH_BYTES) r.fail('model', `a hash of ${size} bytes`);
      return { kind, atUs, model: hexOf(r.bytes('model', size)) || null };
    case 'word':
      return { kind, atUs, word: readWord(r) };
    case 'end':
      return null;
  }
}

function checked(r: ByteReader, what: string, size: number, most: number): number {
  if (size > most) r.fail(what, `${size} bytes, ${most} allowed`);
  return size;
}

/** Adds the place of a frame to its error. */
function placed<T>(at: number, take: () => T): T {
  try {
    return take();
  } catch (error) {
    if (error instanceof SegmentError) refuse(`byte ${at}`, error.message);
    throw error;
  }
}

function checkFrames(header: Header, chain: FrameChain): void {
  if (chain.copies > 0 && chain.count === 0) refuse('records', 'copies without frames');
  if (header.frames !== chain.count) refuse('header', `${header.frames} frames said, ${chain.count} there`);
  if (header.firstSeq !== chain.firstSeq || header.lastSeq !== chain.lastSeq) {
    const named = `frames ${header.firstSeq} to ${header.lastSeq} said`;
    refuse('header', `${named}, ${chain.firstSeq} to ${chain.lastSeq} there`);
  }
}
