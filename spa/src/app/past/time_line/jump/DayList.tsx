import { useEffect, useRef, useState, useSyncExternalStore } from 'react';
import type { PastControls, Timeline } from '../../../../past/past_types.ts';
import { formatClock } from '../../../../twin/format.ts';
import { languageTag } from '../../../text/language.ts';
import { useMomentsText } from '../../../text/moments.ts';
import { dayOf, listDays, listHours, unknownOf } from './recorded_days.ts';

/** How many days are listed at first, and how many more at each press. */
const DAYS = 14;
/** For this many days, the hours are shown at once: a moment today or yesterday is two taps away. */
const OPEN = 2;

/** The days on which something was recorded, newest first, with their hours. */
export function DayList({ controls, onGo }: { controls: PastControls; onGo: (momentMs: number) => void }) {
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
