/** The page of KEYs (SPEC §11): the first pose of each segment of ten minutes, for looking through them. */

import { FRAME_BYTES_MAX } from '../frame.ts';
import { type ByteReader, hexOf } from './byte_reader.ts';
import { openEnvelope } from './envelope.ts';
import { FrameChain } from './frame_chain.ts';
import { readName } from './reader.ts';
import { HASH_BYTES, refuse, SegmentError, U32_MAX } from './segment.ts';

export const KEY_PAGE = { magic: [0x89, 0x50, 0x43, 0x4b], version: 1, what: 'page of KEYs' };
export const PAGE_BYTES_MAX = 1 << 20;
export const POSES_MAX = 4096;
export const MOMENT_MS_MAX = 1_199_999; // a segment begins within ten minutes, and lasts no longer than ten more
export const FROM_MS_MAX = Number.MAX_SAFE_INTEGER - MOMENT_MS_MAX;
export const POSE = 1; // the kind of an entry

/**
 * The first pose of a segment: its first frame, accepted at `atMs` (unix, rounded down) and `lateUs` late then. `frame`
 * is a KEY, or `copies` has the KEY that it names: that is decoded before it, and is no pose of this moment.
 * `take`, `runId`: 16 hexadecimal digits; `schema`, `model`: SHA-256, hexadecimal.
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

type Row = readonly [take: string, runId: string];

/** Decodes a page; frames are parts of `data`. Entries of unknown kinds are passed over. SegmentError when it is none. */
export function decodeKeyPage(data: Uint8Array): KeyPage {
  if (data.length > PAGE_BYTES_MAX)
    refuse(`byte ${PAGE_BYTES_MAX}`, `page of ${data.length} bytes, ${PAGE_BYTES_MAX} allowed`);
  const { header: r, records, count } = openEnvelope(data, KEY_PAGE);
  const robot = readName(r, 'robot');
  const view = readName(r, 'view');
  const fromMs = r.varint('from', FROM_MS_MAX);
  const takes = Array.from({ length: r.varint('takes', POSES_MAX) }, () => readTake(r));
  const hashes = Array.from({ length: r.varint('hashes', POSES_MAX) }, () =>
    hexOf(r.bytes('hash', HASH_BYTES)),
  );
  return { robot, view, fromMs, poses: readPoses(records, count, fromMs, takes, hashes) };
}

/** By moment, then take, then index. */
export function inOrder(a: KeyPose, b: KeyPose): number {
  if (a.atMs !== b.atMs) return a.atMs - b.atMs;
  if (a.take !== b.take) return a.take < b.take ? -1 : 1;
  return a.index - b.index;
}

export function nameOf({ take, index }: KeyPose): string {
  return `take ${take}, index ${index}`;
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
  const count = r.varint('copies', 1);
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

/** The number of the frame, which is a KEY or names the copied one. */
export function checkFrames(copies: readonly Uint8Array[], frame: Uint8Array): number {
  const chain = new FrameChain();
  for (const copy of copies) chain.addCopy(copy);
  return chain.addFrame(frame);
}
