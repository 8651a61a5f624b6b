import { type PointerEvent, useEffect, useMemo, useRef, useState } from 'react';
import type { PastControls, Playhead, Span, Timeline } from '../../../past/past_types.ts';
import { formatClockSeconds } from '../../../twin/format.ts';
import { usePageKeys } from '../../shell/page_keys.ts';
import { useStore } from '../../state/use_store.ts';
import { usePastText } from '../../text/late.ts';
import { hundredthsWords } from '../../words/moment.ts';
import { loopStart } from './loop_start.ts';
import { lineKeys } from './past_keys.ts';
import { Scrubber } from './scrubber.ts';
import { useSpoken } from './spoken.ts';
import { Tip } from './Tip.tsx';
import { TrackPicture } from './TrackPicture.tsx';
import type { Tick } from './ticks.ts';
import { type Hover, msAt, pxAt, TIME_PX, type View } from './track_view.ts';

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
