import './past.css';
import { type ReactNode, useLayoutEffect, useMemo, useRef, useState, useSyncExternalStore } from 'react';
import type { PastControls, Playhead, Timeline } from '../../../past/past_types.ts';
import { IconButton } from '../../shell/icons.tsx';
import { late } from '../../shell/late.tsx';
import { useNow } from '../../shell/now.ts';
import { dayWords, notKeptWords, spanWords } from '../../status/moment_words.ts';
import { more, useMore } from '../../text/more.ts';
import { usePastText } from '../../text/past.ts';
import { PauseIcon, PlayIcon } from './past_icons.tsx';
import { Track } from './Track.tsx';
import { type Range, RECENT_MS, shownSpan, type View } from './track_view.ts';

const TransportBar = late(async () => (await import('./TransportBar.tsx')).TransportBar);

/** A window up to this long is always shown whole, ms. */
const SHORT_MS = 360_000;
/** How often the time moves on, ms. */
const STEP_MS = { least: 250, most: 2000 };

/** What stands in a row below the track, at its moments. */
export type BelowTrack = (view: View) => ReactNode;

/** The last minutes of a robot in one line under its body, or all of a recording: how it moved, what happened, and where in time
 *  the page is. Live, and where it is to stay so, it is slim; in the past it opens, with what plays it. Where nothing is known of
 *  the past there is but room. */
export function TimeLine({
  controls,
  slim = false,
  notes = null,
}: {
  controls: PastControls;
  slim?: boolean;
  /** A recording's notes. */
  notes?: BelowTrack | null;
}) {
  const playhead = useSyncExternalStore(controls.onChange, () => controls.playhead);
  const known = useSyncExternalStore(controls.onChange, () => controls.timeline);
  if (known === null && playhead.at === 'live') return <div className="past-room" />;
  const { momentMs } = playhead;
  const unknown = { fromMs: momentMs, toMs: momentMs, movement: [], words: [], marks: [] };
  return <Line {...{ controls, slim, notes }} timeline={known ?? unknown} />;
}

function Line(props: {
  controls: PastControls;
  timeline: Timeline;
  slim: boolean;
  notes: BelowTrack | null;
}) {
  const { controls, timeline, slim, notes } = props;
  const text = usePastText();
  const { playhead } = controls;
  const past = playhead.at === 'past';
  const room = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState({ widthPx: 0, heightPx: 0 });
  const [range, setRange] = useState<Range>('all');
  // Under a finger nothing moves: neither the time nor the page.
  const [held, setHeld] = useState<{ view: View; open: boolean } | null>(null);
  const shown = useRef<View | null>(null);

  const { nowMs } = controls;

  const windowMs = nowMs - timeline.fromMs;
  const hasRanges = windowMs > SHORT_MS;
  const shownMs = hasRanges && range === 'all' ? windowMs : RECENT_MS;
  const stepMs = stepOf(shownMs / Math.max(1, size.widthPx));
  useNow(past ? Math.min(1000, stepMs) : stepMs);
  const whole = { fromMs: timeline.fromMs, toMs: Math.ceil(nowMs / stepMs) * stepMs };
  const isRecorded = playhead.recorded !== null && timeline.toMs > timeline.fromMs;
  const isAll = isRecorded && !(hasRanges && range === 'recent'); // however short it is
  const span = isAll
    ? timeline
    : shownSpan(whole, hasRanges ? range : 'all', playhead.momentMs, shown.current);
  const { fromMs, toMs } = span;
  const { widthPx, heightPx } = size;
  const now = useMemo(() => ({ fromMs, toMs, widthPx }), [fromMs, toMs, widthPx]);
  const view = held?.view ?? now;
  shown.current = view;
  const open = held?.open ?? (past && !slim);

  // biome-ignore lint/correctness/useExhaustiveDependencies: open, it is higher, and not a picture later
  useLayoutEffect(() => {
    const element = room.current;
    if (element === null) return;
    const measure = () => {
      const { width, height } = element.getBoundingClientRect();
      setSize({ widthPx: Math.round(width), heightPx: Math.round(height) });
    };
    measure();
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    return () => observer.disconnect();
  }, [open]);

  useMore(); // the notes' words
  const { note } = playhead;
  return (
    <section
      className="time-line"
      aria-label={text.timeLine}
      data-open={open}
      data-at={playhead.at}
      data-testid="time-line"
    >
      {note !== null && note !== 'loading' && !(playhead.recorded !== null && note === 'damaged') && (
        <p className="past-note" role="status" data-testid="past-note">
          {noteWords(playhead, nowMs)}
        </p>
      )}
      {open && (
        <TransportBar
          controls={controls}
          playhead={playhead}
          nowMs={nowMs}
          hasFaults={timeline.marks.some(({ level }) => level === 'fault')}
        >
          {hasRanges && <RangeButton range={range} windowMs={windowMs} onRange={setRange} />}
        </TransportBar>
      )}
      <div className="time-row">
        <PlayButton playing={playhead.playing || !past} onPress={() => controls.toggle()} />
        <div className="track-room" ref={room}>
          {widthPx > 0 && (
            <Track
              {...{ controls, playhead, timeline, view, heightPx, nowMs, open }}
              onHold={(hold) => setHeld(hold ? { view, open } : null)}
            />
          )}
        </div>
        <IconButton
          className="line-button"
          label={text.explainLine}
          title={text.explainLine}
          aria-haspopup="dialog"
          data-explain="timeLine"
        >
          ?
        </IconButton>
        {playhead.recorded === null && (
          <button
            type="button"
            className="line-button to-live"
            aria-pressed={!past}
            title={past ? text.toLive : undefined}
            data-testid="to-live"
            onClick={() => controls.goLive()}
          >
            {text.live}
            <svg viewBox="0 0 8 10" aria-hidden="true">
              <path d="M1 1v8l6-4z" />
            </svg>
          </button>
        )}
        {notes !== null && widthPx > 0 && <div className="below-track">{notes(view)}</div>}
      </div>
    </section>
  );
}

const NOTES = { resumed: 'pastResumed', damaged: 'pastDamaged', away: 'pastAway' } as const;

function noteWords({ note, askedMs, momentMs, recorded }: Playhead, nowMs: number): string {
  const text = more();
  if (note === 'not-kept')
    return `${recorded?.lacks(askedMs!, momentMs) ?? notKeptWords(askedMs!, momentMs, nowMs)}.`;
  if (note === 'away' && recorded !== null) return text.recordingAway;
  return note === 'not-come'
    ? text.notCome(dayWords(askedMs!, nowMs))
    : text[NOTES[note as keyof typeof NOTES]];
}

/** Of powers of two, so that it seldom changes, the one by which the time moves on by about a pixel, ms. */
function stepOf(msPerPx: number): number {
  const step = 250 * 2 ** Math.ceil(Math.log2(Math.max(1, msPerPx) / 250));
  return Math.min(STEP_MS.most, Math.max(STEP_MS.least, step));
}

function PlayButton({ playing, onPress }: { playing: boolean; onPress: () => void }) {
  const text = usePastText();
  const name = playing ? text.pause : text.play;
  return (
    <IconButton
      className="icon-button time-play"
      label={name}
      title={name}
      data-testid="play"
      onClick={onPress}
    >
      {playing ? <PauseIcon /> : <PlayIcon />}
    </IconButton>
  );
}

/** Between all there is and the last five minutes. Both are named; where there is less room, only the one that is shown. */
function RangeButton({
  range,
  windowMs,
  onRange,
}: {
  range: Range;
  windowMs: number;
  onRange: (range: Range) => void;
}) {
  const text = usePastText();
  const lengths = { recent: spanWords(RECENT_MS), all: spanWords(windowMs) };
  const other = range === 'all' ? 'recent' : 'all';
  const name = text.showLast(lengths[other]);
  return (
    <button
      type="button"
      className="segments range"
      aria-label={name}
      title={name}
      data-testid="range"
      onClick={() => onRange(other)}
    >
      {(['recent', 'all'] as const).map((each) => (
        <span key={each} data-on={each === range}>
          {lengths[each]}
        </span>
      ))}
    </button>
  );
}
