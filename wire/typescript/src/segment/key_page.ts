/** The page of KEYs (SPEC §11): the first pose of each segment of ten minutes, for looking through them. */

import { FRAME_BYTES_MAX } from '../frame.ts';
import { type ByteReader, hexOf } from './byte_reader.ts';
import { ByteWriter, hashOf } from './byte_writer.ts';
import { openEnvelope, packEnvelope } from './envelope.ts';
import { FrameChain } from './frame_chain.ts';
import { readName, readUntilFrame } from './reader.ts';
import { HASH_BYTES, NAME, NAME_BYTES_MAX, refuse, type Segment, SegmentError, U32_MAX } from './segment.ts';

const PAGE = { magic: [0x89, 0x50, 0x43, 0x4b], version: 1, what: 'page of KEYs' };
const PAGE_BYTES_MAX = 1 << 20;
const POSES_MAX = 4096;
const MOMENT_MS_MAX = 1_199_999; // a segment begins within ten minutes, and lasts no longer than ten more
const FROM_MS_MAX = Number.MAX_SAFE_INTEGER - MOMENT_MS_MAX;
const POSE = 1; // the kind of an entry

/**
 * The first pose of a segment: its first frame, accepted at `atMs` (unix, rounded down) and `lateUs` late then. `frame`
 * is a KEY, or `copies` has the KEY, and the newest REF if there was one: they are decoded before it, and are no poses
 * of this moment. `take`, `runId`: 16 hexadecimal digits; `schema`, `model`: SHA-256, hexadecimal.
 */
export interface KeyPose {
  readonly atMs: number;
  readonly take: string;
  readonly runId: string;
  readonly index: number;
  readonly schema: string;
  readonly model: string | null;
  readonly lateUs: number;
  readonly seq: number;
  readonly copies: readonly Uint8Array[];
  readonly frame: Uint8Array;
}

/** Poses of segments that begin in the ten minutes from `fromMs` (unix), ordered by moment. */
export interface KeyPage {
  readonly robot: string;
  readonly view: string;
  readonly fromMs: number;
  readonly poses: readonly KeyPose[];
}

type Begun = Pick<Segment, 'start' | 'records'>;
type Row = readonly [take: string, runId: string];

/** The first pose of a segment; null if it has no frames. Of bytes only what stands before the first frame is decoded.
 *  SegmentError when they are no segment. */
export function pickPose(segment: Segment | Uint8Array): KeyPose | null {
  return poseOf(segment instanceof Uint8Array ? readUntilFrame(segment) : segment);
}

/**
 * The page of segments in any order, or of poses picked of them before. `page.fromMs`: the beginning of the ten
 * minutes. `every`: takes each n-th pose, from the first; of more than fit, each 2n-th, and so on. SegmentError for
 * segments of another robot or view, outside the ten minutes, or given twice.
 */
export function encodeKeyPage(
  page: Omit<KeyPage, 'poses'>,
  segments: Iterable<Segment | Uint8Array | KeyPose>,
  every = 1,
): Uint8Array {
  if (!(Number.isInteger(every) && every >= 1)) refuse('every', `${every}, at least 1 allowed`);
  const poses: KeyPose[] = [];
  for (const segment of segments) {
    const pose = 'copies' in segment ? segment : poseWithin(page, segment);
    if (pose !== null) poses.push(pose);
  }
  poses.sort(inOrder);
  for (let step = every; ; step *= 2) {
    const picked = poses.filter((_, i) => i % step === 0);
    if (picked.length > POSES_MAX) continue;
    const data = pack({ ...page, poses: picked });
    if (data.length <= PAGE_BYTES_MAX) return data;
  }
}

/** Decodes a page; frames are parts of `data`. Entries of unknown kinds are passed over. SegmentError when it is none. */
export function decodeKeyPage(data: Uint8Array): KeyPage {
  if (data.length > PAGE_BYTES_MAX)
    refuse(`byte ${PAGE_BYTES_MAX}`, `page of ${data.length} bytes, ${PAGE_BYTES_MAX} allowed`);
  const { header: r, records, count } = openEnvelope(data, PAGE);
  const robot = readName(r, 'robot');
  const view = readName(r, 'view');
  const fromMs = r.varint('from', FROM_MS_MAX);
  const takes = Array.from({ length: r.varint('takes', POSES_MAX) }, () => readTake(r));
  const hashes = Array.from({ length: r.varint('hashes', POSES_MAX) }, () =>
    hexOf(r.bytes('hash', HASH_BYTES)),
  );
  return { robot, view, fromMs, poses: readPoses(records, count, fromMs, takes, hashes) };
}

function poseWithin({ robot, view }: Omit<KeyPage, 'poses'>, segment: Segment | Uint8Array): KeyPose | null {
  const begun = segment instanceof Uint8Array ? readUntilFrame(segment) : segment;
  const { start } = begun;
  if (start.robot !== robot || start.view !== view)
    refuse('segment', `of ${start.robot}/${start.view}, not ${robot}/${view}`);
  return poseOf(begun);
}

function poseOf({ start, records }: Begun): KeyPose | null {
  const { fromMs, take, runId, index, schema } = start;
  const copies: Uint8Array[] = [];
  let { model } = start;
  for (const record of records) {
    if (record.kind === 'copy') copies.push(record.frame);
    else if (record.kind === 'model') model = record.model;
    else if (record.kind === 'frame') {
      if (schema === null) refuse('header', 'frames without a schema or run');
      const atMs = fromMs + Math.floor(record.atUs / 1000);
      const { lateUs, seq, frame } = record;
      return { atMs, take, runId, index, schema, model, lateUs, seq, copies, frame };
    }
  }
  return null;
}

/** By moment, then take, then index. */
function inOrder(a: KeyPose, b: KeyPose): number {
  if (a.atMs !== b.atMs) return a.atMs - b.atMs;
  if (a.take !== b.take) return a.take < b.take ? -1 : 1;
  return a.index - b.index;
}

function nameOf({ take, index }: KeyPose): string {
  return `take ${take}, index ${index}`;
}

function pack({ robot, view, fromMs, poses }: KeyPage): Uint8Array {
  if (!NAME.test(robot) || !NAME.test(view)) refuse('header', 'robot or view: no name');
  const takes = new Map<string, number>();
  const hashes = new Map<string, number>();
  const names = new Set<string>();
  const entries = new ByteWriter();
  for (const pose of poses) {
    const name = nameOf(pose);
    if (names.has(name)) refuse('segment', `${name}: given twice`);
    names.add(name);
    const content = packPose(pose, fromMs, takes, hashes);
    entries.byte(POSE);
    entries.varint('length', content.length);
    entries.bytes(content);
  }
  const header = new ByteWriter();
  header.text('robot', robot, NAME_BYTES_MAX);
  header.text('view', view, NAME_BYTES_MAX);
  header.varint('from', fromMs, FROM_MS_MAX);
  header.varint('takes', takes.size);
  for (const row of takes.keys()) for (const digits of row.split(' ')) header.u64('take', digits);
  header.varint('hashes', hashes.size);
  for (const row of hashes.keys()) header.bytes(hashOf('hash', row));
  return packEnvelope(PAGE, header.data, entries.data, poses.length);
}

function packPose(
  pose: KeyPose,
  fromMs: number,
  takes: Map<string, number>,
  hashes: Map<string, number>,
): Uint8Array {
  if (checkFrames(pose.copies, pose.frame) !== pose.seq) refuse('frame', `its number is not ${pose.seq}`);
  if (/^0+$/.test(pose.runId)) refuse('take', 'take and run are u64, and the run is not 0');
  const to = new ByteWriter();
  to.varint('moment', pose.atMs - fromMs, MOMENT_MS_MAX);
  to.varint('take', rowOf(takes, `${pose.take} ${pose.runId}`));
  to.varint('index', pose.index, U32_MAX);
  to.varint('schema', rowOf(hashes, pose.schema) + 1);
  to.varint('model', pose.model === null ? 0 : rowOf(hashes, pose.model) + 1);
  to.varint('lateness', pose.lateUs);
  to.varint('copies', pose.copies.length);
  for (const frame of [...pose.copies, pose.frame]) {
    to.varint('frame length', frame.length);
    to.bytes(frame);
  }
  return to.data;
}

/** The row of a table in which it stands, at its end if it is new. */
function rowOf(table: Map<string, number>, what: string): number {
  const row = table.get(what) ?? table.size;
  table.set(what, row);
  return row;
}

function readTake(r: ByteReader): Row {
  const take = r.u64('take');
  const runId = r.u64('run');
  if (/^0+$/.test(runId)) r.fail('run', '0 is none');
  return [take, runId];
}

function readPoses(
  r: ByteReader,
  count: number,
  fromMs: number,
  takes: readonly Row[],
  hashes: readonly string[],
): KeyPose[] {
  const poses: KeyPose[] = [];
  const names = new Set<string>();
  const { end } = r;
  let found = 0;
  if (count > POSES_MAX) refuse(`byte ${end}`, `${count} entries, ${POSES_MAX} allowed`);
  while (r.at < end) {
    const start = r.at;
    const kind = r.byte('kind');
    const size = r.varint('length', end - r.at);
    if (size > end - r.at) r.fail('length', `${size} bytes said, ${end - r.at} left`);
    if (kind === 0) refuse(`byte ${start}`, 'an end before the end');
    found++;
    r.end = r.at + size;
    if (kind === POSE) {
      const pose = readPose(r, fromMs, takes, hashes);
      const before = poses.at(-1);
      if (before && inOrder(before, pose) >= 0) refuse(`byte ${start}`, 'a pose out of order');
      const name = nameOf(pose);
      if (names.has(name)) refuse(`byte ${start}`, `${name}: a segment twice`);
      names.add(name);
      poses.push(pose);
    }
    r.at = r.end;
    r.end = end;
  }
  if (found !== count) refuse(`byte ${end}`, `${found} entries, ${count} said`);
  return poses;
}

function readPose(r: ByteReader, fromMs: number, takes: readonly Row[], hashes: readonly string[]): KeyPose {
  const atMs = fromMs + r.varint('moment', MOMENT_MS_MAX);
  const row = r.varint('take');
  const [take, runId] = takes[row] ?? r.fail('take', `row ${row} of ${takes.length}`);
  const index = r.varint('index', U32_MAX);
  const schema = readRow(r, 'schema', hashes) ?? r.fail('schema', 'none');
  const model = readRow(r, 'model', hashes);
  const lateUs = r.varint('lateness');
  const count = r.varint('copies', 2);
  const { at } = r;
  const copies = Array.from({ length: count }, () => readFrame(r));
  const frame = readFrame(r);
  try {
    const seq = checkFrames(copies, frame);
    return { atMs, take, runId, index, schema, model, lateUs, seq, copies, frame };
  } catch (error) {
    if (error instanceof SegmentError) refuse(`byte ${at}`, error.message);
    throw error;
  }
}

function readFrame(r: ByteReader): Uint8Array {
  return r.bytes('frame', r.varint('frame length', FRAME_BYTES_MAX));
}

function readRow(r: ByteReader, what: string, hashes: readonly string[]): string | null {
  const row = r.varint(what);
  if (row > hashes.length) r.fail(what, `row ${row} of ${hashes.length}`);
  return hashes[row - 1] ?? null;
}

/** The number of the frame, which is a KEY or has its base in the copies. */
function checkFrames(copies: readonly Uint8Array[], frame: Uint8Array): number {
  const chain = new FrameChain();
  for (const copy of copies) chain.addCopy(copy);
  return chain.addFrame(frame);
}
