import type { RobotStatus } from '@posecast/wire';
import type { SegmentRef } from '../past_source.ts';
import type { Mark, Span, Timeline } from '../past_types.ts';
import { MINUTE_MS, type PastMinute } from './past_documents.ts';

/** A minute, and how much moved in it. */
export type KnownMinute = Omit<PastMinute, 'bytes'> & { readonly bytesPerS: number };

/** A minute of which segments are known up to `unknownMs` only. */
type PartlyKnown = KnownMinute & { readonly unknownMs: number };

/** Takes tell times of their own, which differ by a few ms. What the one before says of the robot beside its last frames
 *  comes before what the next one says with its first. */
const TAKES_APART_MS = 100;

interface Change {
  readonly atMs: number;
  readonly word: RobotStatus;
  /** Its place among the others. */
  readonly orderMs: number;
}

/** Draws a time line: of segments where they are known, else of minutes. Both are ordered by time. `unknown`: days of which
 *  neither is. */
export function drawTimeline(
  span: Span,
  segments: readonly SegmentRef[],
  minutes: readonly PartlyKnown[],
  unknown: readonly Span[] = [],
): Timeline {
  const movement: Timeline['movement'][number][] = [];
  const marks: Mark[] = [];
  const isCut = (atMs: number) => unknown.some(({ fromMs }) => fromMs > atMs);
  const changes: Change[] = [];

  for (const { fromMs, toMs, frames, bytes, words, events } of segments) {
    if (frames > 0) movement.push({ fromMs, toMs, bytesPerS: (1000 * bytes) / Math.max(1, toMs - fromMs) });
    for (const { atMs, word } of words)
      changes.push({ atMs, word, orderMs: frames > 0 ? atMs : atMs - TAKES_APART_MS });
    for (const { atMs, level, source, text, state } of events)
      if (state === 'on' && level !== 'info') marks.push({ atMs, level, source, text, exact: true });
  }

  minutes.forEach(({ atMs, unknownMs, bytesPerS, frames, word, faults }, i) => {
    const nextMs = minutes[i + 1]?.atMs;
    // of what is newer than the newest minute only the end is known: until it is asked for again it goes on as it was
    const toMs = Math.min(nextMs === undefined && !isCut(atMs) ? span.toMs : atMs + MINUTE_MS, span.toMs);
    const fromMs = Math.max(atMs, unknownMs, span.fromMs);
    if (fromMs >= toMs) return;
    if (frames > 0) movement.push({ fromMs, toMs, bytesPerS });
    changes.push({ atMs: fromMs, word, orderMs: fromMs });
    // who was offline when nothing more came was offline until something came again
    if (word !== 'offline' || nextMs === toMs) changes.push({ atMs: toMs, word: 'online', orderMs: toMs });
    // which of them began before `unknownMs` can't be told
    if (faults > 0 && unknownMs <= atMs)
      marks.push({
        ...{ atMs: fromMs, level: 'fault', source: '', text: '', exact: false },
        ...(faults > 1 ? { count: faults } : {}),
      });
  });

  for (const { fromMs } of unknown) changes.push({ atMs: fromMs, word: 'online', orderMs: fromMs });
  movement.sort((a, b) => a.fromMs - b.fromMs);
  marks.sort((a, b) => a.atMs - b.atMs);
  const drawn = { ...span, movement, words: drawWords(span, changes), marks };
  return unknown.length > 0 ? { ...drawn, unknown } : drawn;
}

function drawWords(span: Span, changes: Change[]): Timeline['words'] {
  changes.sort((a, b) => a.orderMs - b.orderMs);
  const words: Timeline['words'][number][] = [];
  let since: Pick<Change, 'atMs' | 'word'> = { atMs: span.fromMs, word: 'online' };
  for (const change of [...changes, { atMs: span.toMs, word: 'online' as const }]) {
    if (change.word === since.word) continue;
    if (since.word !== 'online' && change.atMs > since.atMs)
      words.push({ fromMs: since.atMs, toMs: change.atMs, word: since.word });
    since = change;
  }
  return words;
}
