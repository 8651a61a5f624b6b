import type { EventMessage } from '@posecast/wire';
import type { PastSource } from '../past_source.ts';
import { inOrder, nameOf } from './happenings.ts';

/** How far back they go, ms. */
const RECENT_MS = 600_000;
const EVENTS_MAX = 100;

/** The newest events before a moment, oldest first, as far as they are known: what somebody would have been told who came
 *  then. `heard`: those that the live stream has told. */
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
