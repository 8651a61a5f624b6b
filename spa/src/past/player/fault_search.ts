import type { PastSource } from '../past_source.ts';
import { type Mark, PAGE_MS } from '../past_types.ts';
import type { Loads } from './tape/loads.ts';
import type { Reel } from './tape/reel.ts';

/** A visit to a fault starts this long before it, ms. */
const BEFORE_FAULT_MS = 2000;
/** Faults that start within this time of each other are one event, ms. */
const ONE_EVENT_MS = 2000;
/** Maximum number of days to fetch in search of a fault. */
const DAYS_MAX = 7;
/** How often the ten minutes around a fault are requested while only its minute is known. */
const TRIES_MAX = 2;

type Fault = Mark & { readonly goesMs: number };

interface SearchParts {
  readonly ports: { readonly source: PastSource };
  readonly reel: Reel;
  readonly loads: Loads;
}

/** Finds the next fault after a moment (`by` 1) or the previous one (-1), with its exact moment if available; null if there is
 *  none. Fetches unknown days on the way, and the ten minutes around the fault. Gives up with null once `isObsolete`. */
export async function searchFault(
  { ports: { source }, reel, loads }: SearchParts,
  by: 1 | -1,
  fromMs: number,
  slackMs: number,
  isObsolete: () => boolean,
): Promise<Fault | null> {
  for (let tries = 0, days = 0; ; ) {
    const mark = faultBeside(source.timeline?.marks ?? [], by, fromMs, slackMs);
    const unknown =
      by > 0
        ? reel.unknownAfter(fromMs, mark?.goesMs ?? Number.POSITIVE_INFINITY)
        : reel.unknownBefore(fromMs, mark?.goesMs ?? Number.NEGATIVE_INFINITY);
    if (unknown !== null && days < DAYS_MAX) {
      days += 1;
      await loads.day(unknown.fromMs);
    } else if (mark === null || mark.exact || tries >= TRIES_MAX) return mark;
    else {
      tries += 1;
      await loads.index(Math.floor(mark.atMs / PAGE_MS));
    }
    if (isObsolete()) return null;
  }
}

/** The fault after or before a moment, with the moment to go to; null if there is none. Going back, a fault within `slackMs` is
 *  skipped as already seen. Of the faults of one event only the first counts. */
function faultBeside(marks: readonly Mark[], by: 1 | -1, momentMs: number, slackMs: number): Fault | null {
  const faults: Fault[] = [];
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
