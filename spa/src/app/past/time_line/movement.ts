import type { Mark, PastControls, Span, Timeline } from '../../../past/past_types.ts';
import { msPerPx, pxAt, type View } from './track_view.ts';

type Heard = PastControls['heard'];

const MINUTE_MS = 60_000;
/** Times of the same event by two clocks of the relay differ by less than this, ms. */
const SAME_MS = 1500;

/** A time line with the marks of events from the live stream, each at its exact moment. While nobody looks back, the relay's
 *  index is requested rarely and has only minutes. `heard`: oldest first. */
export function withHeard(timeline: Timeline, heard: Heard): Timeline {
  const complete = heard.slice(firstWithoutGap(heard));
  const told = complete.flatMap(markOf).filter(({ atMs }) => atMs >= timeline.fromMs);
  const sinceMs = 1000 * (complete[0]?.at ?? Number.POSITIVE_INFINITY);
  // more may have happened than was heard in a minute that started earlier
  const kept = timeline.marks.filter(({ exact, atMs }) => exact || atMs < sinceMs);
  const isKnown = (mark: Mark) =>
    kept.some((each) =>
      each.exact
        ? each.source === mark.source && each.text === mark.text && Math.abs(each.atMs - mark.atMs) < SAME_MS
        : mark.atMs >= each.atMs && mark.atMs < each.atMs + MINUTE_MS,
    );
  const added = told.filter((mark) => !isKnown(mark));
  if (added.length === 0 && kept.length === timeline.marks.length) return timeline;
  return { ...timeline, marks: [...kept, ...added].sort((a, b) => a.atMs - b.atMs) };
}

/** The index from which on no event is missing. */
function firstWithoutGap(heard: Heard): number {
  let first = heard.length - 1;
  while (first > 0 && heard[first - 1]!.n === heard[first]!.n - 1 && heard[first - 1]!.at !== null)
    first -= 1;
  return Math.max(0, first);
}

function markOf({ at, level, source, text, state }: Heard[number]): readonly Mark[] {
  if (at === null || state !== 'on' || level === 'info') return [];
  return [{ atMs: 1000 * at, level, source, text, exact: true }];
}

/** Gaps shorter than this count as continuous recording, ms. */
const JOINED_MS = 250;
/** If the newest data is older than this, the robot is not on air, ms. */
const UNTOLD_MS_MAX = 60_000;
/** Minimum distance of the curve's points, CSS px. */
const POINT_PX = 3;
/** Minimum height, so that recorded time is visible even without movement, CSS px. */
const LEAST_PX = 1.5;

export interface Run extends Span {
  readonly points: readonly { readonly atMs: number; readonly bytesPerS: number }[];
}

/** What was recorded without a gap, with the movement as points at least `bucketMs` apart. Buckets lie at fixed times, so that
 *  the curve keeps its shape as it moves on. */
export function runsOf(movement: Timeline['movement'], bucketMs: number): Run[] {
  const runs: {
    fromMs: number;
    toMs: number;
    sums: Map<number, { at: number; bytes: number; ms: number }>;
  }[] = [];
  const joinedMs = Math.max(JOINED_MS, bucketMs / 16); // a gap that is too narrow to be seen is none
  for (const { fromMs, toMs, bytesPerS } of movement) {
    let run = runs.at(-1);
    if (run === undefined || fromMs - run.toMs > joinedMs) {
      run = { fromMs, toMs, sums: new Map() };
      runs.push(run);
    }
    run.toMs = Math.max(run.toMs, toMs);
    const middle = (fromMs + toMs) / 2;
    const bucket = Math.floor(middle / bucketMs);
    const sum = run.sums.get(bucket) ?? { at: 0, bytes: 0, ms: 0 };
    const ms = Math.max(1, toMs - fromMs);
    run.sums.set(bucket, {
      ...{ at: sum.at + middle * ms, bytes: sum.bytes + bytesPerS * ms, ms: sum.ms + ms },
    });
  }
  return runs.map(({ fromMs, toMs, sums }) => ({
    ...{ fromMs, toMs },
    points: [...sums.values()].map(({ at, bytes, ms }) => ({ atMs: at / ms, bytesPerS: bytes / ms })),
  }));
}

/** Extends a time line, whose newest end is updated rarely, up to a moment that this page knows to be recorded. Until the next
 *  update, the movement is assumed to continue. */
export function goingOn(timeline: Timeline, untilMs: number): Timeline {
  const last = timeline.movement.at(-1);
  const hasWord = (timeline.words.at(-1)?.toMs ?? 0) >= timeline.toMs;
  const isBetween = !hasWord && untilMs > timeline.toMs && untilMs - timeline.toMs < UNTOLD_MS_MAX;
  if (last === undefined || !isBetween || timeline.toMs - last.toMs > JOINED_MS) return timeline;
  const movement = [...timeline.movement, { ...last, fromMs: last.toMs, toMs: untilMs }];
  return { ...timeline, toMs: untilMs, movement };
}

/** A time line with everything that the page itself knows: the events heard, and that it extends to the shown moment (unix
 *  ms). */
export function completed(timeline: Timeline, heard: PastControls['heard'], shownMs: number): Timeline {
  return withHeard(goingOn(timeline, shownMs), heard);
}

/** The curve as an SVG path: an area over `basePx`, as high as `heightPx` for `mostBytesPerS`, on a square-root scale. */
export function movementPath(
  movement: Timeline['movement'],
  view: View,
  { basePx, heightPx, mostBytesPerS }: { basePx: number; heightPx: number; mostBytesPerS: number },
): string {
  const marginMs = POINT_PX * 4 * msPerPx(view) + 10_000;
  const seen = movement.filter(
    ({ fromMs, toMs }) => toMs > view.fromMs - marginMs && fromMs < view.toMs + marginMs,
  );
  const x = (ms: number) => round(pxAt(view, ms));
  const y = (bytesPerS: number) =>
    round(basePx - Math.max(LEAST_PX, heightPx * Math.min(1, Math.sqrt(bytesPerS / mostBytesPerS))));
  let path = '';
  for (const { fromMs, toMs, points } of runsOf(seen, bucketOf(view))) {
    const spots = points.map(({ atMs, bytesPerS }) => [x(atMs), y(bytesPerS)] as const);
    path += `M${x(fromMs)} ${basePx}V${spots[0]![1]}`;
    for (const [i, [px, py]] of spots.entries()) {
      const [nextX, nextY] = spots[i + 1] ?? [x(toMs), py];
      path += i === 0 ? `L${px} ${py}` : '';
      path += `Q${px} ${py} ${round((px + nextX) / 2)} ${round((py + nextY) / 2)}`;
    }
    path += `L${x(toMs)} ${spots.at(-1)![1]}V${basePx}Z`;
  }
  return path;
}

/** The next power of two of 250 ms: it stays the same while a view grows a little. */
function bucketOf(view: View): number {
  return 250 * 2 ** Math.max(0, Math.ceil(Math.log2((POINT_PX * msPerPx(view)) / 250)));
}

function round(px: number): number {
  return Math.round(px * 10) / 10;
}
