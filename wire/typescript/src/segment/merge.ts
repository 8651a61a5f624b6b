/** Segments of overlapping takes as one stream of frames (SPEC §10, *Writing*). */

import { frameId, parseHeader } from '../frame.ts';
import { type Segment, SegmentError } from './segment.ts';

/**
 * A frame, accepted at `atMs` (unix, with µs as its fraction), `lateUs` late then. `copies` are decoded
 * before it: its bases, as far as the frames before it in the merged stream are not these.
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

/** `place`: a frame's number without its turns, from the first one seen of its run. `key`, `ref`: the newest before it
 *  in its segment. */
interface Candidate extends Omit<MergedFrame, 'copies'> {
  readonly place: number;
  readonly key: Uint8Array | null;
  readonly ref: Uint8Array | null;
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
    const bases = new Bases();
    run.forEach(({ place, key, ref, ...frame }, i) => {
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
      frames.push({ ...frame, copies: bases.missingFor(frame.frame, key, ref) });
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
  let ref: Uint8Array | null = null;
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
      if (!run.has(place)) run.set(place, { runId, seq, atMs, lateUs, schema, frame, place, key, ref });
    }
    const header = parseHeader(frame);
    if (header.isKey) [key, ref] = [frame, null];
    else if (header.isRef) ref = frame;
  }
}

function byPlace(run: Map<number, Candidate>): Candidate[] {
  return [...run.values()].sort((a, b) => a.place - b.place);
}

/** What a decoder that has followed the merged stream has as bases. */
class Bases {
  #key: number | null = null;
  #ref: number | null = null;

  /** Follows a frame. What must be decoded before it, of the KEY and REF that its segment has. */
  missingFor(frame: Uint8Array, key: Uint8Array | null, ref: Uint8Array | null): Uint8Array[] {
    const header = parseHeader(frame);
    const copies: Uint8Array[] = [];
    if (!header.isKey && header.baseId !== this.#key && header.baseId !== this.#ref) {
      if (key !== null && frameId(key) !== this.#key) {
        this.#take(key);
        copies.push(key);
      }
      if (ref !== null && frameId(ref) === header.baseId) {
        this.#take(ref);
        copies.push(ref);
      }
    }
    if (header.isKey || header.isRef) this.#take(frame);
    return copies;
  }

  #take(frame: Uint8Array): void {
    if (!parseHeader(frame).isKey) this.#ref = frameId(frame);
    else [this.#key, this.#ref] = [frameId(frame), null];
  }
}
