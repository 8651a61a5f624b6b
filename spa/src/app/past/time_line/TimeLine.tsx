import './past.css';
import {
  type ReactNode,
  useEffect,
  useLayoutEffect,
  useMemo,
  useRef,
  useState,
  useSyncExternalStore,
} from 'react';
import type { PastControls, Playhead, Timeline } from '../../../past/past_types.ts';
import { Icon, IconButton } from '../../shell/icons.tsx';
import { withKey } from '../../shell/page_keys.ts';
import { useStore, useTicked } from '../../state/hooks.ts';
import { useSettings } from '../../state/settings.ts';
import { languageTag, more } from '../../text/language.ts';
import { usePastText } from '../../text/late.ts';
import { dayWords, notKeptWords } from '../../words/moment.ts';
import { listenToGestures } from './gestures.ts';
import { chooseOn, chosenOn, fitScale, scaleFor, scaleIn, scalesOf } from './line.ts';
import { completed } from './movement.ts';
import { Track } from './Track.tsx';
import { ScaleChoice, TransportBar } from './TransportBar.tsx';
import { listTicks } from './ticks.ts';
import { msPerPx, pxAt, shownSpan, textPxOf, type View } from './track_view.ts';

const PlayIcon = () => (
  <Icon>
    <path d="M8 5.4v13.2L18.6 12z" fill="currentColor" />
  </Icon>
);

const PauseIcon = () => (
  <Icon>
    <path d="M8.5 6v12M15.5 6v12" strokeWidth="3" />
  </Icon>
);

/** A leaf of a calendar. */
const JumpIcon = () => (
  <Icon>
    <path d="M4.5 7.5a2 2 0 0 1 2-2h11a2 2 0 0 1 2 2v10a2 2 0 0 1-2 2h-11a2 2 0 0 1-2-2zM4.5 10.5h15M8.5 3.5v4M15.5 3.5v4M12 13v2.6l1.8 1" />
  </Icon>
);

/** Minimum and maximum interval between updates of the time, ms; a line that shows days updates less often. */
const STEP_MS = { least: 250, most: 2000 };
/** A repeated span is drawn at least this wide if a finer scale allows it, CSS px. */
const LOOP_PX = 24;

/** Shown in a row below the track, at its moments. */
export type BelowTrack = (view: View) => ReactNode;

/** The last minutes of a robot in one line under its body, or all of a recording: movement, events, and the playhead. It is slim
 *  while live, and wherever it must stay slim. In the past it expands to show the playback controls and, if `onSave` is given,
 *  the save button. While nothing is known about the past, it only reserves the space. */
export function TimeLine({
  controls,
  slim = false,
  notes = null,
  onSave = null,
}: {
  controls: PastControls;
  slim?: boolean;
  /** A recording's notes. */
  notes?: BelowTrack | null;
  onSave?: (() => void) | null;
}) {
  const playhead = useSyncExternalStore(controls.onChange, () => controls.playhead);
  const known = useSyncExternalStore(controls.onChange, () => controls.timeline);
  if (known === null && playhead.at === 'live') return <div className="past-room" />;
  const { momentMs } = playhead;
  const unknown = { fromMs: momentMs, toMs: momentMs, movement: [], words: [], marks: [] };
  return <Line {...{ controls, slim, notes, onSave }} timeline={known ?? unknown} />;
}

function Line(props: {
  controls: PastControls;
  timeline: Timeline;
  slim: boolean;
  notes: BelowTrack | null;
  onSave: (() => void) | null;
}) {
  const { controls, timeline, slim, notes, onSave } = props;
  const text = usePastText();
  useSettings(); // for the names of keys
  const { playhead, nowMs, heard, behindMs } = controls;
  const past = playhead.at === 'past';
  const room = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState({ widthPx: 0, heightPx: 0 });
  const { scaleMs: chosen, isNarrow } = useStore(chosenOn(controls));
  // Nothing moves under a finger: neither the time nor the page.
  const [held, setHeld] = useState<{ view: View; open: boolean } | null>(null);
  const shown = useRef<View | null>(null);

  const windowMs = nowMs - timeline.fromMs;
  const scale = scaleIn(windowMs, chosen, isNarrow);
  const stepMs = stepOf(Math.min(scale, windowMs) / Math.max(1, size.widthPx));
  const stepped = (ms: number) => Math.ceil(ms / stepMs) * stepMs;
  useTicked(Math.min(past ? 1000 : STEP_MS.most, stepMs), () => [
    past ? Math.floor(controls.nowMs / 1000) : stepped(controls.nowMs - controls.behindMs),
    controls.heard.at(-1)?.n,
  ]);
  // delayed live data ends where the picture is
  const whole = { fromMs: timeline.fromMs, toMs: stepped(nowMs - behindMs) };
  const isWhole = playhead.recorded !== null && scale >= windowMs && timeline.toMs > timeline.fromMs;
  // a recording is shown at its full length, however short
  const span = isWhole ? timeline : shownSpan(whole, scale, playhead.momentMs, shown.current);
  const { fromMs, toMs } = span;
  const { widthPx, heightPx } = size;
  const now = useMemo(() => ({ fromMs, toMs, widthPx }), [fromMs, toMs, widthPx]);
  const view = held?.view ?? now;
  shown.current = view;
  const open = held?.open ?? (past && !slim);
  const textPx = textPxOf(heightPx, open);
  const language = languageTag();
  // biome-ignore lint/correctness/useExhaustiveDependencies: the words depend on the language
  const ticks = useMemo(
    () => listTicks(view, { pxAt: (atMs) => pxAt(view, atMs), widthPx: view.widthPx, textPx }),
    [view, textPx, language],
  );

  const { unknown } = timeline;
  // biome-ignore lint/correctness/useExhaustiveDependencies: `unknown` lists what to fetch
  useEffect(() => controls.look({ fromMs, toMs }), [controls, fromMs, toMs, unknown]);

  const shownMs = stepped(playhead.momentMs);
  const drawn = useMemo(() => completed(timeline, heard, shownMs), [timeline, heard, shownMs]);

  const { loop } = playhead;
  // biome-ignore lint/correctness/useExhaustiveDependencies: only for a new loop; the viewer may choose a longer scale later
  useEffect(() => {
    if (loop === null || widthPx === 0) return;
    const lengthMs = loop.toMs - loop.fromMs;
    if (lengthMs >= LOOP_PX * msPerPx(now)) return;
    chooseOn(controls, { scaleMs: scaleFor(scalesOf(windowMs), (lengthMs * widthPx) / LOOP_PX) });
  }, [loop]);

  // biome-ignore lint/correctness/useExhaustiveDependencies: `open` changes the element
  useEffect(() => {
    if (room.current === null) return;
    return listenToGestures(room.current, controls);
  }, [controls, open]);

  // biome-ignore lint/correctness/useExhaustiveDependencies: `open` changes the height, at once
  useLayoutEffect(() => {
    const element = room.current;
    if (element === null) return;
    const measure = () => {
      const { width, height } = element.getBoundingClientRect();
      setSize({ widthPx: Math.round(width), heightPx: Math.round(height) });
      if (width > 0) fitScale(controls, width);
    };
    measure();
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    return () => observer.disconnect();
  }, [open]);

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
          hasFaults={unknown !== undefined || drawn.marks.some(({ level }) => level === 'fault')}
          onSave={onSave}
        >
          {scalesOf(windowMs).length > 1 && <ScaleChoice {...{ controls, scale, windowMs }} />}
        </TransportBar>
      )}
      <div className="time-row">
        <PlayButton playing={playhead.playing || !past} onPress={() => controls.toggle()} />
        <div className="track-room" ref={room}>
          {widthPx > 0 && (
            <Track
              {...{ controls, playhead, timeline: drawn, view, ticks, heightPx, nowMs, open }}
              onHold={(hold) => setHeld(hold ? { view, open } : null)}
            />
          )}
        </div>
        <IconButton
          className="line-button line-jump"
          label={text.jump}
          title={withKey(text.jump, 'jump')}
          aria-haspopup="dialog"
          data-testid="jump"
          onClick={() => chooseOn(controls, { isJumpOpen: true })}
        >
          <JumpIcon />
        </IconButton>
        <IconButton
          className="line-button line-explain"
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
            title={past ? withKey(text.toLive, 'live') : undefined}
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

const NOTES = {
  resumed: 'pastResumed',
  unlooped: 'pastUnlooped',
  damaged: 'pastDamaged',
  away: 'pastAway',
} as const;

function noteWords({ note, askedMs, momentMs, recorded }: Playhead, nowMs: number): string {
  const text = more();
  if (note === 'not-kept')
    return `${recorded?.lacks(askedMs!, momentMs) ?? notKeptWords(askedMs!, momentMs, nowMs)}.`;
  if (note === 'away' && recorded !== null) return text.recordingAway;
  return note === 'not-come'
    ? text.notCome(dayWords(askedMs!, nowMs))
    : text[NOTES[note as keyof typeof NOTES]];
}

/** The time that corresponds to about one pixel, ms, rounded to a power of two so that it rarely changes. */
function stepOf(pxMs: number): number {
  return Math.max(STEP_MS.least, 250 * 2 ** Math.ceil(Math.log2(Math.max(1, pxMs) / 250)));
}

function PlayButton({ playing, onPress }: { playing: boolean; onPress: () => void }) {
  const text = usePastText();
  const name = playing ? text.pause : text.play;
  return (
    <IconButton
      className="icon-button time-play"
      label={name}
      title={withKey(name, 'play')}
      data-testid="play"
      onClick={onPress}
    >
      {playing ? <PauseIcon /> : <PlayIcon />}
    </IconButton>
  );
}
