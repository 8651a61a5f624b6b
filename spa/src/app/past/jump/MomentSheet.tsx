import '../../shell/styles/choices.css';
import './jump.css';
import { type FormEvent, useEffect, useId, useRef, useState, useSyncExternalStore } from 'react';
import type { PastControls, Timeline } from '../../../past/past_types.ts';
import { formatClock, formatClockSeconds } from '../../../twin/format.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import { Dialog } from '../../shell/Dialog.tsx';
import { languageTag } from '../../text/language.ts';
import { useMomentsText } from '../../text/late.ts';
import { dayWords } from '../../words/moment.ts';
import { chooseOn } from '../time_line/line.ts';
import { Incidents } from './Incidents.tsx';
import { dayOf, listDays, listHours, nearestRecorded, unknownOf } from './recorded_days.ts';

/** How many days are listed at first, and how many more at each press. */
const DAYS = 14;
/** For this many days, the hours are shown at once: a moment today or yesterday is two taps away. */
const OPEN = 2;

/** The days on which something was recorded, newest first, with their hours. */
function DayList({ controls, onGo }: { controls: PastControls; onGo: (momentMs: number) => void }) {
  const text = useMomentsText();
  const timeline = useSyncExternalStore(controls.onChange, () => controls.timeline);
  const [count, setCount] = useState(DAYS);
  if (timeline === null) return null;
  const days = listDays(timeline);
  return (
    <section className="moment-days" aria-label={text.days} data-testid="moment-days">
      <h3>{text.days}</h3>
      {days.slice(0, count).map((dayMs, i) => (
        <Day key={dayMs} {...{ controls, timeline, dayMs, onGo }} isFirst={i < OPEN} />
      ))}
      {days.length > count && (
        <button type="button" className="text-button" onClick={() => setCount(count + DAYS)}>
          {text.olderDays}
        </button>
      )}
    </section>
  );
}

function Day({
  controls,
  timeline,
  dayMs,
  isFirst,
  onGo,
}: {
  controls: PastControls;
  timeline: Timeline;
  dayMs: number;
  isFirst: boolean;
  onGo: (momentMs: number) => void;
}) {
  const text = useMomentsText();
  const [open, setOpen] = useState(isFirst);
  const isAway = useDay(controls, timeline, dayMs, open);
  const unknown = unknownOf(timeline, dayMs).length > 0;
  const hours = open ? listHours(timeline, dayMs) : [];
  const words = useDayWords(controls.nowMs)(dayMs);
  return (
    <details open={open} onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary>{words}</summary>
      {open && unknown && <p className="quiet">{isAway ? text.dayAway : text.dayLoading}</p>}
      {open && !unknown && hours.length === 0 && <p className="quiet">{text.dayEmpty}</p>}
      {hours.length > 0 && (
        <ul className="moment-hours" aria-label={text.hoursOf(words)}>
          {hours.map(({ atMs, fromMs, faults }) => {
            const clock = formatClock(fromMs);
            const when = text.hour(clock, words);
            const name = faults === 0 ? when : `${when}, ${text.hourFaults(faults)}`;
            return (
              <li key={fromMs}>
                <button
                  type="button"
                  aria-label={name}
                  title={name}
                  data-faults={faults > 0}
                  onClick={() => onGo(atMs)}
                >
                  {clock}
                </button>
              </li>
            );
          })}
        </ul>
      )}
    </details>
  );
}

/** Fetches the unknown parts of an open day. Returns whether it is currently unavailable. */
function useDay(controls: PastControls, timeline: Timeline, dayMs: number, open: boolean): boolean {
  const [isAway, setAway] = useState(false);
  const asked = useRef('');
  const unknown = open ? unknownOf(timeline, dayMs) : [];
  const wanted = unknown.map(({ fromMs }) => fromMs).join();
  useEffect(() => {
    if (wanted === '' || asked.current === wanted) return;
    asked.current = wanted;
    void Promise.all(wanted.split(',').map((fromMs) => controls.loadDay(Number(fromMs)))).then((known) =>
      setAway(known.includes(false)),
    );
  }, [controls, wanted]);
  return isAway;
}

/** The name of a day: "today · Tue 24 Nov". */
function useDayWords(nowMs: number): (dayMs: number) => string {
  const text = useMomentsText();
  return (dayMs) => {
    const today = dayOf(nowMs);
    const date = new Date(dayMs).toLocaleDateString(languageTag(), {
      ...{ weekday: 'short', day: 'numeric', month: 'short' },
      ...(new Date(dayMs).getFullYear() === new Date(nowMs).getFullYear() ? {} : { year: 'numeric' }),
    } as const);
    if (dayMs === today) return `${date} · ${text.today}`;
    return dayMs === dayOf(today - 1) ? `${date} · ${text.yesterday}` : date;
  };
}

/** A recorded moment this near counts as the requested one, ms. */
const NEAR_MS = 2000;
/** An older end is one, ms. */
const NEWEST_MS = 30_000;
/** An incomplete date sends no requests for this long, ms. */
const TYPED_MS = 400;

/** A form for a day and a time by the viewer's clock; if nothing was recorded then, it leads to the nearest recorded moment. */
function MomentForm({ controls, onGo }: { controls: PastControls; onGo: (momentMs: number) => void }) {
  const text = useMomentsText();
  const timeline = useSyncExternalStore(controls.onChange, () => controls.timeline);
  const hint = useId();
  const [begunMs] = useState(() => controls.playhead.momentMs);
  const [date, setDate] = useState(() => dateValue(begunMs));
  const [time, setTime] = useState(() => formatClockSeconds(begunMs));
  const momentMs = new Date(`${date}T${time}`).getTime();
  const unknown = useTypedDay(controls, timeline, momentMs);
  if (timeline === null) return null;
  const { nowMs } = controls;
  const fromMs = Math.floor(timeline.fromMs / 1000) * 1000; // as fields have it
  const nearestMs = Number.isNaN(momentMs) ? null : nearestRecorded(timeline, momentMs);
  // what is newest is told a little later
  const isNewest = momentMs >= timeline.toMs && nowMs - timeline.toMs < NEWEST_MS;
  const say = () => {
    if (Number.isNaN(momentMs)) return text.kept(dayWords(fromMs, nowMs), dayWords(nowMs, nowMs));
    if (momentMs > nowMs) return text.toCome;
    if (momentMs < fromMs) return text.tooOld(dayWords(fromMs, nowMs));
    if (unknown) return text.looking;
    if (isNewest) return text.wasRecorded;
    if (nearestMs === null || Math.abs(nearestMs - momentMs) <= NEAR_MS) return text.wasRecorded;
    return text.nearest(dayWords(nearestMs, nowMs));
  };
  const go = (event: FormEvent) => {
    event.preventDefault();
    if (momentMs > nowMs || Number.isNaN(momentMs)) return;
    const isThere = isNewest || nearestMs === null || unknown || Math.abs(nearestMs - momentMs) <= NEAR_MS;
    onGo(isThere || momentMs < fromMs ? momentMs : nearestMs);
  };
  return (
    <form className="moment-form" onSubmit={go} noValidate>
      <label>
        {text.date}
        <input
          type="date"
          value={date}
          min={dateValue(fromMs)}
          max={dateValue(nowMs)}
          required
          aria-describedby={hint}
          data-testid="moment-date"
          onChange={(event) => setDate(event.currentTarget.value)}
        />
      </label>
      <label>
        {text.time}
        <input
          type="time"
          step="1"
          value={time}
          required
          aria-describedby={hint}
          data-testid="moment-time"
          onChange={(event) => setTime(event.currentTarget.value)}
        />
      </label>
      <button type="submit" className="moment-go" disabled={!(momentMs <= nowMs)} data-testid="moment-go">
        {text.go}
      </button>
      <p className="quiet" id={hint} role="status" data-testid="moment-hint">
        {say()}
      </p>
    </form>
  );
}

/** Fetches the recorded data on the day of a typed moment. Returns whether it is still unknown. */
function useTypedDay(controls: PastControls, timeline: Timeline | null, momentMs: number): boolean {
  const [failedMs, setFailedMs] = useState<number | null>(null);
  const unknown =
    failedMs !== momentMs &&
    (timeline?.unknown?.some(({ fromMs, toMs }) => momentMs >= fromMs && momentMs < toMs) ?? false);
  useEffect(() => {
    if (!unknown) return;
    let isLeft = false;
    const timer = setTimeout(async () => {
      const isKnown = await controls.loadDay(momentMs);
      if (!isKnown && !isLeft) setFailedMs(momentMs);
    }, TYPED_MS);
    return () => {
      isLeft = true;
      clearTimeout(timer);
    };
  }, [controls, unknown, momentMs]);
  return unknown;
}

/** The viewer's day in the format of an input: 2026-11-22. */
function dateValue(atMs: number): string {
  const at = new Date(atMs);
  const two = (value: number) => String(value).padStart(2, '0');
  return `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`;
}

const WAYS = ['byTime', 'byFault'] as const;

/** The dialog for going to a moment: by day and time, or to one of the last faults. */
export function MomentSheet({ controls, twin }: { controls: PastControls; twin: RobotTwin }) {
  const text = useMomentsText();
  const name = useId();
  const [way, setWay] = useState<(typeof WAYS)[number]>('byTime');
  const close = () => chooseOn(controls, { isJumpOpen: false });
  const openAt = (momentMs: number) => {
    close();
    controls.openAt(momentMs);
  };
  const seek = (momentMs: number) => {
    close();
    controls.seek(momentMs);
  };
  return (
    <Dialog title={text.jump} testId="moment-sheet" onClose={close}>
      <fieldset className="choice moment-ways">
        <legend className="unseen">{text.jump}</legend>
        <div className="segments">
          {WAYS.map((each) => (
            <label key={each}>
              <input type="radio" name={name} checked={each === way} onChange={() => setWay(each)} />
              <span>{text[each]}</span>
            </label>
          ))}
        </div>
      </fieldset>
      {way === 'byTime' ? (
        <>
          <MomentForm controls={controls} onGo={openAt} />
          <DayList controls={controls} onGo={openAt} />
        </>
      ) : (
        <Incidents controls={controls} twin={twin} onGo={seek} />
      )}
      <button
        type="button"
        className="text-button moment-explain"
        aria-haspopup="dialog"
        data-explain="timeLine"
        onClick={close}
      >
        {text.explainLine}
      </button>
    </Dialog>
  );
}
