import type { EventMessage } from '@posecast/wire';
import type { PastSource } from '../../past_source.ts';
import type { PastEvent, Span } from '../../past_types.ts';
import { inOrder, nameOf } from './happenings.ts';
import { PAGE_MS } from './loads.ts';

const MINUTE_MS = 60_000;

/** How far back recent events go, ms. */
const RECENT_MS = 600_000;
const EVENTS_MAX = 100;

/** The known events in a span, oldest first, without the duplicates of overlapping takes. `heard`: events from the live stream;
 *  its newest are in no segment yet. */
export function listEvents(
  source: PastSource,
  heard: readonly EventMessage[],
  { fromMs, toMs }: Span,
): readonly PastEvent[] {
  const told = heard.flatMap((event) => (event.at === null ? [] : [{ ...event, atMs: 1000 * event.at }]));
  const recorded = source.segmentsIn({ fromMs, toMs }).flatMap((ref) => ref.events);
  const within = [...told, ...recorded].filter(({ atMs }) => atMs >= fromMs && atMs <= toMs);
  const once = new Map(within.map((event) => [nameOf(event), event]));
  return [...once.values()].sort((a, b) => a.atMs - b.atMs);
}

/** The number of the page before a moment's own, if it must be fetched to know the recent faults at that moment; null if the
 *  marks of the time line show none there. */
export function pageBefore({ timeline }: PastSource, momentMs: number): number | null {
  const sinceMs = momentMs - RECENT_MS;
  const endMs = momentMs - (momentMs % PAGE_MS);
  if (timeline === null || endMs <= timeline.fromMs) return null;
  const isUnknown =
    timeline.unknown?.some(({ fromMs, toMs }) => fromMs < endMs && toMs > sinceMs) ||
    timeline.marks.some(({ atMs, exact }) => !exact && atMs < endMs && atMs > sinceMs - MINUTE_MS);
  return isUnknown === true ? Math.floor(sinceMs / PAGE_MS) : null;
}

/** The newest known events before a moment, oldest first: what a viewer who joined then would have received. `heard`: events from
 *  the live stream. */
export function listRecentEvents(
  source: PastSource,
  heard: readonly EventMessage[],
  momentMs: number,
): readonly EventMessage[] {
  const fromMs = momentMs - RECENT_MS;
  const recorded = source.segmentsIn({ fromMs, toMs: momentMs }).flatMap(({ events }) => events);
  const recent = [...recorded, ...heard].filter(
    ({ at }) => at !== null && at * 1000 > fromMs && at * 1000 <= momentMs,
  );
  const events = new Map(recent.map((event) => [nameOf(event), event]));
  return inOrder([...events.values()]).slice(-EVENTS_MAX);
}
