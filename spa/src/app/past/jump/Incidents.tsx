import './jump.css';
import { useEffect, useMemo, useRef, useState, useSyncExternalStore } from 'react';
import type { PastControls } from '../../../past/past_types.ts';
import { fillSentence, sentenceOf } from '../../../twin/alarms/sentence.ts';
import { flagWords, formatClockSeconds, formatSpan } from '../../../twin/format.ts';
import { isolated, wordsOfName } from '../../../twin/names.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import { languageTag, type More, useMore } from '../../text/language.ts';
import { useMomentsText } from '../../text/late.ts';
import { dayWords } from '../../words/moment.ts';
import { INCIDENTS_MAX, type Incident, listIncidents, newestHole } from './incident_list.ts';

/** Playback starts this long before a fault, to show what led up to it. */
const BEFORE_MS = 2000;
/** How much is fetched at a time, pages and days. */
const FETCHED_MAX = 8;
/** As in the alarms: the count shown for this many or more. */
const TIMES_MAX = 30;

/** The newest recorded faults, newest first; each links to two seconds before it. Unknown parts are fetched gradually. */
export function Incidents({
  controls,
  twin,
  onGo,
}: {
  controls: PastControls;
  twin: RobotTwin;
  onGo: (momentMs: number) => void;
}) {
  const text = useMomentsText();
  const timeline = useSyncExternalStore(controls.onChange, () => controls.timeline);
  const { heard } = controls;
  const { state, hole, search } = useSearch(controls);
  // biome-ignore lint/correctness/useExhaustiveDependencies: `heard` contains the newest events
  const incidents = useMemo(
    () => (timeline === null ? [] : listIncidents(controls, timeline, hole?.untilMs ?? timeline.fromMs)),
    [controls, timeline, heard, hole?.untilMs],
  );
  const isFull = incidents.length >= INCIDENTS_MAX;
  const status = () => {
    if (state === 'looking') return text.faultLooking;
    if (state === 'away') return text.faultAway;
    if (isFull) return text.faultMost(INCIDENTS_MAX);
    if (hole !== null) return '';
    return incidents.length === 0 ? text.faultNone : text.faultAll;
  };
  return (
    <section className="incidents" data-testid="incidents" aria-label={text.faults}>
      {incidents.length > 0 && (
        <ol>
          {incidents.map((incident) => (
            <Row
              key={`${incident.event.n} ${incident.event.atMs}`}
              {...{ incident, onGo }}
              twin={twin}
              nowMs={controls.nowMs}
            />
          ))}
        </ol>
      )}
      <p className="quiet" role="status">
        {status()}
      </p>
      {hole !== null && !isFull && state !== 'looking' && (
        <button type="button" className="text-button" data-testid="more-incidents" onClick={search}>
          {text.faultMore}
        </button>
      )}
    </section>
  );
}

function Row({
  incident: { event, lastedMs, times },
  twin,
  nowMs,
  onGo,
}: {
  incident: Incident;
  twin: RobotTwin;
  nowMs: number;
  onGo: (momentMs: number) => void;
}) {
  const text = useMomentsText();
  const rest = useMore();
  const { atMs } = event;
  const { said, code } = incidentSentence(twin, event, rest);
  const isToday = new Date(atMs).toDateString() === new Date(nowMs).toDateString();
  const when = isToday ? formatClockSeconds(atMs) : dayWords(atMs, nowMs);
  const often =
    times === null || times < 2
      ? ''
      : times < TIMES_MAX
        ? rest.timesLately(times)
        : rest.manyTimesLately(times);
  const details = [code, lastedMs === null ? '' : text.lasted(formatSpan(lastedMs)), often];
  return (
    <li>
      <button type="button" title={rest.lookBack} onClick={() => onGo(atMs - BEFORE_MS)}>
        <time>{when}</time>
        <i aria-hidden="true" />
        <span>
          {said} <small>{details.filter((each) => each !== '').join(' · ')}</small>
        </span>
      </button>
    </li>
  );
}

/** The alarm sentence for a past fault, without its current state. */
function incidentSentence(twin: RobotTwin, { source, text }: { source: string; text: string }, rest: More) {
  const name = wordsOfName(twin.schema, source, languageTag());
  const words = flagWords(text);
  const say = sentenceOf(twin.schema, source, text, languageTag())?.say ?? rest.flagReported;
  const given: Record<string, string> = { joint: name ?? source, word: words };
  const filled = fillSentence(say, (place) => given[place] ?? null);
  const begun =
    name !== null && filled.startsWith(name) ? filled[0]!.toUpperCase() + filled.slice(1) : filled;
  const said = name === null && !filled.includes(source) ? `${source}: ${begun}` : begun;
  return { said: isolated(said), code: name === null ? '' : isolated(source) };
}

/** Fetches what is missing, newest first: some at once, more at each `search`. */
function useSearch(controls: PastControls) {
  const timeline = useSyncExternalStore(controls.onChange, () => controls.timeline);
  const [state, setState] = useState<'looking' | 'away' | null>(null);
  const given = useRef(new Set<number>());
  const isLeft = useRef(false);
  const hole = timeline === null ? null : newestHole(timeline, given.current);
  const search = async () => {
    setState('looking');
    for (let fetched = 0; fetched < FETCHED_MAX && !isLeft.current; fetched += 1) {
      const now = controls.timeline;
      const next = now === null ? null : newestHole(now, given.current);
      if (now === null || next === null) break;
      if (listIncidents(controls, now, next.untilMs).length >= INCIDENTS_MAX) break;
      const isHere = await (next.kind === 'day'
        ? controls.loadDay(next.atMs)
        : controls.loadEvents(next.atMs));
      if (!isHere) {
        setState('away');
        return;
      }
      const after = controls.timeline;
      // its events are here, and none of them is a fault: the minutes were counted of what is not kept any more
      if (after !== null && newestHole(after, given.current)?.atMs === next.atMs)
        given.current.add(next.atMs);
    }
    setState(null);
  };
  const begin = useRef(search);
  useEffect(() => {
    isLeft.current = false;
    void begin.current();
    return () => {
      isLeft.current = true;
    };
  }, []);
  return { state, hole, search: () => void search() };
}
