import './past.css';
import { useLayoutEffect, useMemo, useRef, useState, useSyncExternalStore } from 'react';
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

/** The last minutes of a robot in one line under its body: how it moved, what happened, and where in time the page is. Live it
 *  is slim; in the past it opens, with what plays it and, if `onSave` says how, saves it. Where nothing is known of the past there is
 *  but room. */
export function TimeLine({
  controls,
  onSave = null,
}: {
  controls: PastControls;
  onSave?: (() => void) | null;
}) {
  const playhead = useSyncExternalStore(controls.onChange, () => controls.playhead);
  const known = useSyncExternalStore(controls.onChange, () => controls.timeline);
  if (known === null && playhead.at === 'live') return <div className="past-room" />;
  const { momentMs } = playhead;
  const unknown = { fromMs: momentMs, toMs: momentMs, movement: [], words: [], marks: [] };
  return <Line controls={controls} timeline={known ?? unknown} onSave={onSave} />;
}

function Line(props: { controls: PastControls; timeline: Timeline; onSave: (() => void) | null }) {
  const { controls, timeline, onSave } = props;
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
  const span = shownSpan(whole, hasRanges ? range : 'all', playhead.momentMs, shown.current);
  const { fromMs, toMs } = span;
  const { widthPx, heightPx } = size;
  const now = useMemo(() => ({ fromMs, toMs, widthPx }), [fromMs, toMs, widthPx]);
  const view = held?.view ?? now;
  shown.current = view;
  const open = held?.open ?? past;

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
      {note !== null && note !== 'loading' && (
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
          onSave={onSave}
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
      </div>
    </section>
  );
}

const NOTES = { resumed: 'pastResumed', damaged: 'pastDamaged', away: 'pastAway' } as const;

function noteWords({ note, askedMs, momentMs }: Playhead, nowMs: number): string {
  const text = more();
  if (note === 'not-kept') return `${notKeptWords(askedMs!, momentMs, nowMs)}.`;
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
