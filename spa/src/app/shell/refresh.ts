import type { RobotTwin } from '../../twin/robot.ts';
import { onSettings } from '../state/settings.ts';

/** Numbers are written ten times a second, as fast as people can read. */
const EVERY_MS = 100;

/** The cost of all numbers of this page so far: writes, and script time in ms. */
export const cost = { writes: 0, scriptMs: 0 };

/** Adds a listener; returns a function that removes it. */
type Subscribe = (listener: () => void) => () => void;

/** Calls `write` after new states and after the events `also`, at most ten times a second, and always after the last one; with
 *  `leastMs`, also after that long without one. Returns a function that stops it. */
export function refreshWith(
  twin: RobotTwin,
  write: () => void,
  also: readonly Subscribe[] = [],
  leastMs?: number,
): () => void {
  let timer: ReturnType<typeof setTimeout> | null = null;
  let wroteMs = Number.NEGATIVE_INFINITY;

  const now = () => {
    timer = null;
    wroteMs = performance.now();
    write();
    cost.writes += 1;
    cost.scriptMs += performance.now() - wroteMs;
  };
  const soon = () => {
    if (timer !== null) return;
    timer = setTimeout(now, Math.max(0, wroteMs + EVERY_MS - performance.now()));
  };
  const leave = [
    twin.onState(soon),
    twin.onChange(soon),
    onSettings(soon),
    ...also.map((subscribe) => subscribe(soon)),
  ];
  const slow = leastMs === undefined ? null : setInterval(soon, leastMs);
  soon();
  return () => {
    if (timer !== null) clearTimeout(timer);
    if (slow !== null) clearInterval(slow);
    for (const off of leave) off();
  };
}
