import type { PastSource } from '../past_source.ts';
import type { Mark } from '../past_types.ts';
import { type Loads, PAGE_MS } from './tape/loads.ts';
import type { Reel } from './tape/reel.ts';

/** How long before a fault one looks at it, ms. */
const BEFORE_FAULT_MS = 2000;
/** Faults that began within this of another are one event with it, ms. */
const ONE_EVENT_MS = 2000;
/** How many days are looked through for one. */
const DAYS_MAX = 7;
/** How often the ten minutes of one are asked for. */
const TRIES_MAX = 2;

type Fault = Mark & { readonly goesMs: number };

interface SearchParts {
  readonly ports: { readonly source: PastSource };
  readonly reel: Reel;
  readonly loads: Loads;
}

/** The fault after or before a moment, exactly if that can be had; null if there is none. Fetches what has to be known of it: days,
 *  and its ten minutes. `isLeft`: nobody waits for it any more. */
export async function searchFault(
  { ports: { source }, reel, loads }: SearchParts,
  by: 1 | -1,
  fromMs: number,
  slackMs: number,
  isLeft: () => boolean,
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
    if (isLeft()) return null;
  }
}

/** The fault after or before a moment, with the moment to go to; null if there is none. `slackMs`: as near as that it
 *  counts as where one comes from. Faults of one event count as the first of them. */
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
