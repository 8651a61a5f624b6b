import type { RobotStatus } from '@posecast/wire';
import type { SegmentRef } from '../past_source.ts';
import { type Mark, MINUTE_MS, type Span, type Timeline } from '../past_types.ts';
import type { PastMinute } from './past_documents.ts';

/** A minute, and the amount of movement in it. */
export type KnownMinute = Omit<PastMinute, 'bytes'> & { readonly bytesPerS: number };

/** A minute whose segments are known only up to `unknownMs`. */
type PartlyKnown = KnownMinute & { readonly unknownMs: number };

/** Takes have their own timestamps, which differ by a few ms. Within this time, the robot state at the end of one take sorts
 *  before the state at the start of the next. */
const TAKES_APART_MS = 100;

interface Change {
  readonly atMs: number;
  readonly word: RobotStatus;
  /** Its position among the others. */
  readonly orderMs: number;
}

/** Draws a time line: from segments where they are known, otherwise from minutes. Both are ordered by time. `unknown`: days for
 *  which neither is known. */
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
    // after the newest minute only the end is known: until the next request, the movement is assumed to continue
    const toMs = Math.min(nextMs === undefined && !isCut(atMs) ? span.toMs : atMs + MINUTE_MS, span.toMs);
    const fromMs = Math.max(atMs, unknownMs, span.fromMs);
    if (fromMs >= toMs) return;
    if (frames > 0) movement.push({ fromMs, toMs, bytesPerS });
    changes.push({ atMs: fromMs, word, orderMs: fromMs });
    // a robot that was offline at the end of the data stays offline until new data arrives
    if (word !== 'offline' || nextMs === toMs) changes.push({ atMs: toMs, word: 'online', orderMs: toMs });
    // it is unknown which of them started before `unknownMs`
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
