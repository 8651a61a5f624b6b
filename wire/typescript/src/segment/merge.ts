/** Segments of overlapping takes as one stream of frames (SPEC §10, *Writing*). */

import { frameId, parseHeader } from '../frame.ts';
import { type Segment, SegmentError } from './segment.ts';

/**
 * A frame, accepted at `atMs` (unix, with µs as its fraction), `lateUs` late then. `copies` are decoded
 * before it: its KEY, if it is not the newest one before it in the merged stream.
 */
export interface MergedFrame {
  readonly runId: string;
  readonly seq: number;
  readonly atMs: number;
  readonly lateUs: number;
  readonly schema: string;
  readonly copies: readonly Uint8Array[];
  readonly frame: Uint8Array;
}

/** `count` frames of a run, from number `firstSeq`, are in no segment. `fromMs`, `toMs`: when the frames before and
 *  behind them were accepted. */
export interface FrameGap {
  readonly runId: string;
  readonly firstSeq: number;
  readonly count: number;
  readonly fromMs: number;
  readonly toMs: number;
}

/** `place`: a frame's number without its turns, from the first one seen of its run. `key`: the newest one before it in
 *  its segment. */
interface Candidate extends Omit<MergedFrame, 'copies'> {
  readonly place: number;
  readonly key: Uint8Array | null;
}

/**
 * The frames of segments of one robot and view, given in any order: by run, in the order in which the runs began, and
 * by number. What several segments have is taken from the one that begins first (of two, from the lowest take).
 * Gaps are named within a run. SegmentError for segments of several robots or views.
 */
export function mergeSegments(segments: Iterable<Segment>): {
  readonly frames: MergedFrame[];
  readonly gaps: FrameGap[];
} {
  const runs = new Map<string, Map<number, Candidate>>();
  for (const segment of inOrder(segments)) addFrames(runs, segment);
  const frames: MergedFrame[] = [];
  const gaps: FrameGap[] = [];
  for (const run of [...runs.values()].map(byPlace)) {
    let keyId: number | null = null; // of the newest KEY that a decoder of the merged stream has
    run.forEach(({ place, key, ...frame }, i) => {
      const before = run[i - 1];
      const missing = before ? place - before.place - 1 : 0;
      if (before && missing > 0)
        gaps.push({
          runId: frame.runId,
          firstSeq: (before.seq + 1) % 2 ** 32,
          count: missing,
          fromMs: before.atMs,
          toMs: frame.atMs,
        });
      const header = parseHeader(frame.frame);
      const lacksKey = !header.isKey && header.baseId !== keyId && key !== null;
      frames.push({ ...frame, copies: lacksKey ? [key] : [] });
      keyId = header.isKey ? frameId(frame.frame) : header.baseId;
    });
  }
  return { frames, gaps };
}

function inOrder(segments: Iterable<Segment>): Segment[] {
  const all = [...segments];
  const first = all[0]?.start;
  for (const { start } of all)
    if (start.robot !== first!.robot || start.view !== first!.view)
      throw new SegmentError(`segment: of ${start.robot}/${start.view}, not ${first!.robot}/${first!.view}`);
  return all.sort(
    ({ start: a }, { start: b }) =>
      a.fromMs - b.fromMs || (a.take === b.take ? 0 : a.take < b.take ? -1 : 1) || a.index - b.index,
  );
}

function addFrames(runs: Map<string, Map<number, Candidate>>, { start, records }: Segment): void {
  const { runId, schema, fromMs } = start;
  let key: Uint8Array | null = null;
  for (const record of records) {
    if (record.kind !== 'copy' && record.kind !== 'frame') continue;
    const { frame } = record;
    if (record.kind === 'frame' && schema !== null) {
      const run = runs.get(runId) ?? new Map<number, Candidate>();
      runs.set(runId, run);
      const [first] = run.values();
      const place = first ? first.place + ((record.seq - first.seq) | 0) : 0;
      const atMs = fromMs + record.atUs / 1000;
      const { seq, lateUs } = record;
      if (!run.has(place)) run.set(place, { runId, seq, atMs, lateUs, schema, frame, place, key });
    }
    if (parseHeader(frame).isKey) key = frame;
  }
}

function byPlace(run: Map<number, Candidate>): Candidate[] {
  return [...run.values()].sort((a, b) => a.place - b.place);
}
