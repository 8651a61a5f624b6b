import type { RobotTwin } from '../../twin/robot.ts';
import { onSettings } from '../settings.ts';

/** Ten times a second is what an eye can read. */
const EVERY_MS = 100;

/** Calls `write` after new states, at most ten times a second, and once more for the last of them. Returns the end. */
export function refreshWith(twin: RobotTwin, write: () => void): () => void {
  let timer: ReturnType<typeof setTimeout> | null = null;
  let wroteMs = Number.NEGATIVE_INFINITY;

  const now = () => {
    timer = null;
    wroteMs = performance.now();
    write();
  };
  const soon = () => {
    if (timer !== null) return;
    timer = setTimeout(now, Math.max(0, wroteMs + EVERY_MS - performance.now()));
  };
  const leave = [twin.onState(soon), twin.onChange(soon), onSettings(soon)];
  soon();
  return () => {
    if (timer !== null) clearTimeout(timer);
    for (const off of leave) off();
  };
}
