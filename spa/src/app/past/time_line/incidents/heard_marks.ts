import type { Mark, PastControls, Timeline } from '../../../../past/past_types.ts';

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
