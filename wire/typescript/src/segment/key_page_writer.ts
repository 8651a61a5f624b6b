/** Writes pages of KEYs (SPEC §11). Apart from what reads them, since a page that only looks back needs none of it. */

import { ByteWriter, hashOf } from './byte_writer.ts';
import { packEnvelope } from './envelope.ts';
import {
  checkFrames,
  FROM_MS_MAX,
  inOrder,
  KEY_PAGE,
  type KeyPage,
  type KeyPose,
  MOMENT_MS_MAX,
  nameOf,
  PAGE_BYTES_MAX,
  POSE,
  POSES_MAX,
} from './key_page.ts';
import { readUntilFrame } from './reader.ts';
import { NAME, NAME_BYTES_MAX, refuse, type Segment, U32_MAX } from './segment.ts';

type Begun = Pick<Segment, 'start' | 'records'>;

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
  return packEnvelope(KEY_PAGE, header.data, entries.data, poses.length);
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
