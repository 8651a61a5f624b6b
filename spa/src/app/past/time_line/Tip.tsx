import './tip.css';
import type { Playhead, Timeline } from '../../../past/past_types.ts';
import { flagWords } from '../../../twin/format.ts';
import { isolated } from '../../../twin/names.ts';
import { pastText } from '../../text/late.ts';
import { markNear, marksNear } from './marks.ts';
import { whenWords } from './spoken.ts';
import { contains, type Hover, msAt, msPerPx, TIME_PX, type View } from './track_view.ts';

/** The space that most labels at a place need beside it, CSS px. */
const TIP_PX = 230;

/** The moment under the pointer, and what is marked there. */
export function Tip({
  timeline,
  view,
  playhead,
  nowMs,
  hover: { xPx, touch },
  headPx,
}: {
  timeline: Timeline;
  view: View;
  playhead: Playhead;
  nowMs: number;
  hover: Hover;
  /** The middle of the playhead's time in the same row; null: there is none. */
  headPx: number | null;
}) {
  const momentMs = msAt(view, xPx);
  const what = whatWords(timeline, view, xPx, momentMs);
  const placePx = Math.min(view.widthPx, Math.max(0, xPx));
  const part = (100 * placePx) / view.widthPx;
  const shift = headPx === null || touch ? `-${part}%` : besideShift(part, placePx, headPx, view.widthPx);
  return (
    <p
      className="track-tip"
      style={{ left: `${part}%`, transform: `translateX(${shift})` }}
      data-touch={touch}
      data-testid="tip"
    >
      {whenWords(playhead, momentMs, nowMs)}
      {what !== '' && <b> {what}</b>}
    </p>
  );
}

/** How far a label is moved so that it stays clear of the playhead's time: on its own side if there is room, else on the other.
 *  `part`: position on the line, percent. */
function besideShift(part: number, xPx: number, headPx: number, widthPx: number): string {
  const hasRoom = { left: headPx > TIP_PX, right: widthPx - headPx > TIP_PX };
  const isRight = xPx < headPx ? !hasRoom.left : hasRoom.right;
  return isRight
    ? `max(-${part}%, ${headPx + TIME_PX - xPx}px)`
    : `min(-${part}%, ${headPx - TIME_PX - xPx}px - 100%)`;
}

/** What is marked at a place, else the state at that time; empty if there is nothing to show. */
export function whatWords(timeline: Timeline, view: View, xPx: number, momentMs: number): string {
  const text = pastText();
  const first = markNear(timeline.marks, view, xPx);
  if (first !== null) {
    if (!first.exact) return text.faultsWithin(first.count ?? 1);
    const what = `${isolated(first.source)} ${isolated(flagWords(first.text))}`;
    const more = marksNear(timeline.marks, view, xPx).reduce((sum, { count = 1 }) => sum + count, -1);
    return more === 0 ? what : text.andMore(what, more);
  }
  const word = timeline.words.find((span) => contains(span, momentMs))?.word;
  if (word !== undefined) return word === 'silent' ? 'STALE' : 'OFFLINE';
  if (timeline.unknown?.some((day) => contains(day, momentMs))) return '';
  const slackMs = 2 * msPerPx(view);
  const last = timeline.movement.at(-1);
  // The newest part is still being recorded.
  if (last === undefined || momentMs > last.toMs) return '';
  const recorded = timeline.movement.some(
    ({ fromMs, toMs }) => momentMs >= fromMs - slackMs && momentMs <= toMs + slackMs,
  );
  return recorded ? '' : text.notRecorded;
}
