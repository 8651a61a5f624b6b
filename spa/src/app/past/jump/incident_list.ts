import type { PastControls, PastEvent, Timeline } from '../../../past/past_types.ts';

/** The length of the list. */
export const INCIDENTS_MAX = 50;
/** How long a fault counts as recent, ms, as in the alarms. */
const LATELY_MS = 600_000;
const MINUTE_MS = 60_000;

/** A fault that began. */
export interface Incident {
  readonly event: PastEvent;
  /** Null if its end is unknown. */
  readonly lastedMs: number | null;
  /** How often it occurred in the ten minutes up to then, including itself; null if not all of them are known. */
  readonly times: number | null;
}

/** The data missing to know all faults down to a moment: ten minutes, or a day. */
export interface Hole {
  readonly atMs: number;
  readonly kind: 'minutes' | 'day';
  /** Nothing newer is missing. */
  readonly untilMs: number;
}

/** The newest gap in the known data, except gaps that could not be filled; null if there is none. */
export function newestHole({ marks, unknown = [] }: Timeline, given: ReadonlySet<number>): Hole | null {
  const minute = marks.findLast(({ level, exact, atMs }) => level === 'fault' && !exact && !given.has(atMs));
  const day = unknown.findLast(({ fromMs }) => !given.has(fromMs));
  const minuteMs = minute === undefined ? Number.NEGATIVE_INFINITY : minute.atMs + MINUTE_MS;
  if (day !== undefined && day.toMs >= minuteMs) return { atMs: day.fromMs, kind: 'day', untilMs: day.toMs };
  return minute === undefined ? null : { atMs: minute.atMs, kind: 'minutes', untilMs: minuteMs };
}

/** The last faults behind a moment, newest first. */
export function listIncidents(
  controls: Pick<PastControls, 'eventsIn' | 'nowMs'>,
  timeline: Timeline,
  sinceMs: number,
): readonly Incident[] {
  const begun = new Map<string, number>();
  const incidents: (Incident & { event: PastEvent; lastedMs: number | null })[] = [];
  const events = controls.eventsIn({
    fromMs: timeline.fromMs,
    toMs: Math.max(timeline.toMs, controls.nowMs),
  });
  for (const event of events) {
    if (event.level !== 'fault') continue;
    const key = keyOf(event);
    const open = begun.get(key);
    if (event.state === 'off') {
      const found = open === undefined ? undefined : incidents[open];
      if (found !== undefined)
        incidents[open!] = { ...found, lastedMs: Math.max(0, event.atMs - found.event.atMs) };
      begun.delete(key);
      continue;
    }
    begun.set(key, incidents.length);
    incidents.push({ event, lastedMs: null, times: null });
  }
  return incidents
    .map((incident, i) => ({ ...incident, times: timesOf(incidents, i, timeline) }))
    .filter(({ event }) => event.atMs >= sinceMs)
    .slice(-INCIDENTS_MAX)
    .reverse();
}

function timesOf(
  incidents: readonly Incident[],
  place: number,
  { marks, unknown = [] }: Timeline,
): number | null {
  const { event } = incidents[place]!;
  const [fromMs, toMs] = [event.atMs - LATELY_MS, event.atMs];
  const isMissing =
    unknown.some((span) => span.toMs > fromMs && span.fromMs < toMs) ||
    marks.some(({ atMs, exact }) => !exact && atMs > fromMs - MINUTE_MS && atMs < toMs);
  if (isMissing) return null;
  let times = 0;
  for (let i = place; i >= 0 && incidents[i]!.event.atMs > fromMs; i -= 1)
    if (keyOf(incidents[i]!.event) === keyOf(event)) times += 1;
  return times;
}

function keyOf({ source, text }: PastEvent): string {
  return `${source}\n${text}`; // no name holds a control character
}
