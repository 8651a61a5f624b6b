import type { Mark, PastControls, Timeline } from '../../../../past/past_types.ts';

type Heard = PastControls['heard'];

const MINUTE_MS = 60_000;
/** What is told of one event by two clocks of the relay differs by less, ms. */
const SAME_MS = 1500;

/** A time line with the marks of what the live stream has told, each at its moment: the relay's index is asked for seldom while
 *  nobody looks back, and tells of minutes only. `heard`: oldest first. */
export function withHeard(timeline: Timeline, heard: Heard): Timeline {
  const complete = heard.slice(firstWithoutGap(heard));
  const told = complete.flatMap(markOf).filter(({ atMs }) => atMs >= timeline.fromMs);
  const sinceMs = 1000 * (complete[0]?.at ?? Number.POSITIVE_INFINITY);
  // of a minute that began before, more may have happened than was heard
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

/** The place from which on none is lacking. */
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
