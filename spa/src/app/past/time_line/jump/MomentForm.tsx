import { type FormEvent, useEffect, useId, useState, useSyncExternalStore } from 'react';
import type { PastControls, Timeline } from '../../../../past/past_types.ts';
import { formatClockSeconds } from '../../../../twin/format.ts';
import { useMomentsText } from '../../../text/moments.ts';
import { dayWords } from '../../../words/moment.ts';
import { nearestRecorded } from './recorded_days.ts';

/** A recorded moment this near counts as the requested one, ms. */
const NEAR_MS = 2000;
/** An older end is one, ms. */
const NEWEST_MS = 30_000;
/** An incomplete date sends no requests for this long, ms. */
const TYPED_MS = 400;

/** A form for a day and a time by the viewer's clock; if nothing was recorded then, it leads to the nearest recorded moment. */
export function MomentForm({ controls, onGo }: { controls: PastControls; onGo: (momentMs: number) => void }) {
  const text = useMomentsText();
  const timeline = useSyncExternalStore(controls.onChange, () => controls.timeline);
  const hint = useId();
  const [begunMs] = useState(() => controls.playhead.momentMs);
  const [date, setDate] = useState(() => dateValue(begunMs));
  const [time, setTime] = useState(() => formatClockSeconds(begunMs));
  const momentMs = new Date(`${date}T${time}`).getTime();
  const unknown = useDay(controls, timeline, momentMs);
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
function useDay(controls: PastControls, timeline: Timeline | null, momentMs: number): boolean {
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
