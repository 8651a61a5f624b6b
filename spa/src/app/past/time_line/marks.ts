import type { Mark, Timeline } from '../../../past/past_types.ts';
import { flagWords } from '../../../twin/format.ts';
import { isolated } from '../../../twin/names.ts';
import { pastText } from '../../text/past.ts';
import { contains, msPerPx, pxAt, type View } from './track_view.ts';

/** How near a tap has to come to a mark, CSS px. */
const NEAR_PX = 10;
/** Marks of one kind nearer than this are drawn as one, CSS px. */
const TOGETHER_PX = 5;
/** A tap on a mark shows what led to it, ms. */
export const BEFORE_MS = 2000;

export interface DrawnMark {
  readonly xPx: number;
  readonly level: Mark['level'];
  readonly exact: boolean;
}

/** The marks that are drawn, cautions first, so that faults lie over them. */
export function drawnMarks(marks: readonly Mark[], view: View): DrawnMark[] {
  const drawn: DrawnMark[] = [];
  for (const level of ['caution', 'fault'] as const) {
    let last: DrawnMark | null = null;
    for (const mark of marks) {
      if (mark.level !== level || !contains(view, mark.atMs)) continue;
      const xPx = pxAt(view, mark.atMs);
      if (last !== null && xPx - last.xPx < TOGETHER_PX) {
        if (last.exact || !mark.exact) continue;
        drawn.pop(); // the exact one tells more
      }
      last = { xPx, level, exact: mark.exact };
      drawn.push(last);
    }
  }
  return drawn;
}

/** The mark that a tap means: the nearest fault, else the nearest caution; null if none is near. */
export function markNear(marks: readonly Mark[], view: View, xPx: number): Mark | null {
  const near = marksNear(marks, view, xPx);
  return near.find(({ level }) => level === 'fault') ?? near[0] ?? null;
}

function marksNear(marks: readonly Mark[], view: View, xPx: number): Mark[] {
  const far = ({ atMs }: Mark) => Math.abs(pxAt(view, atMs) - xPx);
  return marks.filter((mark) => far(mark) <= NEAR_PX).sort((a, b) => far(a) - far(b));
}

/** What is marked at a place, else what was then; empty if there is nothing to say. */
export function whatWords(timeline: Timeline, view: View, xPx: number, momentMs: number): string {
  const text = pastText();
  const first = markNear(timeline.marks, view, xPx);
  if (first !== null) {
    const said = `${isolated(first.source)} ${isolated(flagWords(first.text))}`;
    const what = first.exact ? said : text.within(said);
    const more = marksNear(timeline.marks, view, xPx).length - 1;
    return more === 0 ? what : text.andMore(what, more);
  }
  const word = timeline.words.find((span) => contains(span, momentMs))?.word;
  if (word !== undefined) return word === 'silent' ? 'STALE' : 'OFFLINE';
  const slackMs = 2 * msPerPx(view);
  const last = timeline.movement.at(-1);
  // The newest part is still being recorded.
  if (last === undefined || momentMs > last.toMs) return '';
  const recorded = timeline.movement.some(
    ({ fromMs, toMs }) => momentMs >= fromMs - slackMs && momentMs <= toMs + slackMs,
  );
  return recorded ? '' : text.notRecorded;
}
