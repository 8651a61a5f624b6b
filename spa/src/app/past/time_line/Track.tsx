import { type KeyboardEvent, type PointerEvent, useEffect, useMemo, useRef, useState } from 'react';
import type { PastControls, Playhead, Span, Timeline } from '../../../past/past_types.ts';
import { formatClockSeconds } from '../../../twin/format.ts';
import { useStore } from '../../state/use_store.ts';
import { hundredthsWords } from '../../status/moment_words.ts';
import { usePastText } from '../../text/past.ts';
import { loopStart } from './loop_start.ts';
import { whatWords } from './marks.ts';
import { playTrackKey } from './past_keys.ts';
import { Scrubber } from './scrubber.ts';
import { useSpoken, whenWords } from './spoken.ts';
import { TrackPicture } from './TrackPicture.tsx';
import { msAt, pxAt, type View } from './track_view.ts';

/** Half of the width of the playhead's time, CSS px. */
const TIME_PX = 45;
/** The room that most words at a place need beside it, CSS px. */
const TIP_PX = 230;

/** The track: all of the time that is shown, its movement and marks, and the playhead. Pressed or dragged, and by arrow keys,
 *  it goes into the past. */
export function Track({
  controls,
  playhead,
  timeline,
  view,
  heightPx,
  nowMs,
  open,
  onHold,
}: {
  controls: PastControls;
  playhead: Playhead;
  timeline: Timeline;
  view: View;
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
  const scrubber = useMemo(() => new Scrubber(controls, nextFrame, setDraft), [controls]);
  useEffect(() => () => scrubber.cancel(), [scrubber]);
  const startMs = useStore(loopStart(controls));
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
  const onKey = (event: KeyboardEvent) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (!playTrackKey(controls, nowMs, event)) return;
    setHover(null); // where the mouse rests is not what is looked at now
    event.preventDefault();
    event.stopPropagation();
  };

  const past = playhead.at === 'past';
  const headPx = Math.min(
    pxAt(view, view.toMs),
    Math.max(pxAt(view, view.fromMs), pxAt(view, playhead.momentMs)),
  );
  const timePx = Math.min(view.widthPx - TIME_PX, Math.max(TIME_PX, headPx)) - headPx;
  return (
    <div
      className="track"
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
      onKeyDown={onKey}
    >
      <TrackPicture
        timeline={timeline}
        view={view}
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
            <time style={{ transform: `translateX(calc(${timePx}px - 50%))` }}>
              {formatClockSeconds(playhead.momentMs)}
              {!playhead.playing && hundredthsWords(playhead.momentMs)}
            </time>
          )}
        </div>
      )}
      {hover !== null && (
        <Tip {...{ timeline, view, playhead, nowMs, hover }} headPx={open && past ? headPx + timePx : null} />
      )}
    </div>
  );
}

/** Where a pointer is on the track, CSS px. `touch`: it covers what is there. */
interface Hover {
  readonly xPx: number;
  readonly touch: boolean;
}

const xOf = (event: PointerEvent) => event.clientX - event.currentTarget.getBoundingClientRect().left;
const hoverOf = (event: PointerEvent): Hover => ({ xPx: xOf(event), touch: event.pointerType === 'touch' });

/** The moment under the pointer, and what is marked there. */
function Tip({
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

/** How far the words at a place are moved so that they stay beside the playhead's time: on the side where the place is if
 *  there is room, else on the other. `part`: of the line, percent. */
function besideShift(part: number, xPx: number, headPx: number, widthPx: number): string {
  const hasRoom = { left: headPx > TIP_PX, right: widthPx - headPx > TIP_PX };
  const isRight = xPx < headPx ? !hasRoom.left : hasRoom.right;
  return isRight
    ? `max(-${part}%, ${headPx + TIME_PX - xPx}px)`
    : `min(-${part}%, ${headPx - TIME_PX - xPx}px - 100%)`;
}

function nextFrame(run: () => void): () => void {
  const asked = requestAnimationFrame(run);
  return () => cancelAnimationFrame(asked);
}
