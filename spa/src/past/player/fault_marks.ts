import type { Mark } from '../past_types.ts';

/** How long before a fault one looks at it, ms. */
export const BEFORE_FAULT_MS = 2000;
/** Faults that began within this of another are one event with it, ms. */
const ONE_EVENT_MS = 2000;

/** The fault after or before a moment, with the moment to go to; null if there is none. `slackMs`: as near as that it
 *  counts as where one comes from. Faults of one event count as the first of them. */
export function faultBeside(
  marks: readonly Mark[],
  by: 1 | -1,
  momentMs: number,
  slackMs: number,
): (Mark & { readonly goesMs: number }) | null {
  const faults: (Mark & { readonly goesMs: number })[] = [];
  for (const mark of marks) {
    if (mark.level !== 'fault' || mark.atMs - (faults.at(-1)?.atMs ?? 0) <= ONE_EVENT_MS) continue;
    faults.push({ ...mark, goesMs: mark.atMs - BEFORE_FAULT_MS });
  }
  const found =
    by > 0
      ? faults.find(({ goesMs }) => goesMs > momentMs + 1)
      : faults.findLast(({ goesMs }) => goesMs < momentMs - slackMs);
  return found ?? null;
}
