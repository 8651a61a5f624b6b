import { type PointerEvent, useEffect, useMemo, useRef, useState } from 'react';
import type { PastControls, Playhead, Span, Timeline } from '../../../past/past_types.ts';
import { flagWords, formatClockSeconds } from '../../../twin/format.ts';
import { usePageKeys } from '../../shell/page_keys.ts';
import { useStore } from '../../state/hooks.ts';
import { pastText, usePastText } from '../../text/late.ts';
import { hundredthsWords } from '../../words/moment.ts';
import { chosenOn, lineKeys } from './line.ts';
import { Scrubber } from './scrubber.ts';
import { useSpoken, whenWords } from './spoken.ts';
import { TrackPicture } from './TrackPicture.tsx';
import type { Tick } from './ticks.ts';
import {
  contains,
  type Hover,
  markNear,
  marksNear,
  msAt,
  msPerPx,
  pxAt,
  TIME_PX,
  type View,
} from './track_view.ts';
import './past.css';
import { isolated } from '../../../twin/names.ts';

/** The track: the shown time span with its movement and marks, and the playhead. Pressing, dragging and arrow keys go into the
 *  past. */
export function Track({
  controls,
  playhead,
  timeline,
  view,
  ticks,
  heightPx,
  nowMs,
  open,
  onHold,
}: {
  controls: PastControls;
  playhead: Playhead;
  timeline: Timeline;
  view: View;
  ticks: readonly Tick[];
  heightPx: number;
  /** The moment of now. */
  nowMs: number;
  open: boolean;
  /** Called when a pointer takes the track and when it lets go. */
  onHold: (held: boolean) => void;
}) {
  const text = usePastText();
  const [draft, setDraft] = useState<Span | null>(null);
  const [hover, setHover] = useState<Hover | null>(null);
  const pointer = useRef<number | null>(null);
  const track = useRef<HTMLDivElement>(null);
  usePageKeys(() => lineKeys(controls, nowMs), track);
  const scrubber = useMemo(() => new Scrubber(controls, nextFrame, setDraft), [controls]);
  useEffect(() => () => scrubber.cancel(), [scrubber]);
  const { loopStartMs: startMs } = useStore(chosenOn(controls));
  const spoken = useSpoken(playhead, nowMs);

  const down = (event: PointerEvent<HTMLDivElement>) => {
    if (event.button !== 0 || pointer.current !== null) return;
    pointer.current = event.pointerId;
    event.currentTarget.setPointerCapture(event.pointerId);
    onHold(true);
    setHover(hoverOf(event));
    scrubber.down(view, nowMs, { ...hoverOf(event), shift: event.shiftKey });
  };
  const move = (event: PointerEvent) => {
    if (pointer.current !== null && pointer.current !== event.pointerId) return;
    setHover(hoverOf(event));
    scrubber.move(xOf(event));
  };
  const release = (event: PointerEvent, done: () => void) => {
    if (pointer.current !== event.pointerId) return;
    pointer.current = null;
    done();
    if (event.pointerType === 'touch') setHover(null);
    onHold(false);
  };

  const past = playhead.at === 'past';
  const headPx = Math.min(
    pxAt(view, view.toMs),
    Math.max(pxAt(view, view.fromMs), pxAt(view, playhead.momentMs)),
  );
  const timePx = Math.min(view.widthPx - TIME_PX, Math.max(TIME_PX, headPx));
  return (
    <div
      className="track"
      ref={track}
      role="slider"
      tabIndex={0}
      aria-label={text.moment}
      aria-valuemin={Math.round((timeline.fromMs - nowMs) / 1000)}
      aria-valuemax={0}
      aria-valuenow={spoken.agoS === 0 ? 0 : -spoken.agoS}
      aria-valuetext={spoken.words}
      data-testid="track"
      onPointerEnter={() => controls.attend()}
      onFocus={() => controls.attend()}
      onPointerDown={down}
      onPointerMove={move}
      onPointerUp={(event) => release(event, () => scrubber.up(xOf(event)))}
      onPointerCancel={(event) => release(event, () => scrubber.cancel())}
      onLostPointerCapture={(event) => release(event, () => scrubber.cancel())}
      onPointerLeave={() => setHover(null)}
      onKeyDown={() => setHover(null)} // what the mouse points at is not what the viewer is looking at now
    >
      <TrackPicture
        timeline={timeline}
        view={view}
        ticks={ticks}
        heightPx={heightPx}
        open={open}
        loop={draft ?? playhead.loop}
      />
      {startMs !== null && (
        <i className="loop-start" style={{ transform: `translateX(${pxAt(view, startMs)}px)` }} />
      )}
      {hover !== null && !scrubber.held && (
        <i
          className="track-hover"
          style={{ transform: `translateX(${pxAt(view, msAt(view, hover.xPx))}px)` }}
        />
      )}
      {past && (
        <div
          className="playhead"
          style={{ transform: `translateX(${headPx}px)` }}
          data-testid="playhead"
          data-loading={playhead.note === 'loading'}
        >
          {open && (
            // percentages are of its own width, which depends on the font: it never leaves the track
            <time
              style={{
                transform: `translateX(clamp(${-headPx}px, -50%, ${view.widthPx - headPx}px - 100%))`,
              }}
            >
              {formatClockSeconds(playhead.momentMs)}
              {!playhead.playing && hundredthsWords(playhead.momentMs)}
            </time>
          )}
        </div>
      )}
      {hover !== null && (
        <Tip {...{ timeline, view, playhead, nowMs, hover }} headPx={open && past ? timePx : null} />
      )}
    </div>
  );
}

const xOf = (event: PointerEvent) => event.clientX - event.currentTarget.getBoundingClientRect().left;
const hoverOf = (event: PointerEvent): Hover => ({ xPx: xOf(event), touch: event.pointerType === 'touch' });

function nextFrame(run: () => void): () => void {
  const asked = requestAnimationFrame(run);
  return () => cancelAnimationFrame(asked);
}

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
