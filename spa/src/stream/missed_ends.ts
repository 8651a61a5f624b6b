import type { EventMessage } from '@posecast/wire';
import { causeOf, FAULTS_MAX } from './told_faults.ts';

const N_STEP = 2 ** -20;

/** End events for faults of `told` that began before a moment (unix ms) and are no longer open, if their end was missed. `open`:
 *  all open faults; `n`: the newest event's number. The end events get numbers between that one and the next. */
export function missedEnds(
  told: readonly EventMessage[],
  open: readonly EventMessage[],
  atMs: number,
  n: number,
): EventMessage[] {
  if (open.length >= FAULTS_MAX) return [];
  const causes = new Set(open.map(causeOf));
  return told
    .filter((event) => event.at !== null && 1000 * event.at < atMs && !causes.has(causeOf(event)))
    .map((event, i) => ({ ...event, n: n + (i + 1) * N_STEP, at: atMs / 1000, state: 'off' }));
}
