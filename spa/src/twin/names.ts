import { readable, type Schema } from '@posecast/wire';

/** Letters that are written from right to left, and their mark. */
const RIGHT_TO_LEFT =
  /[\u200f\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc\u{10800}-\u{10fff}\u{1e800}-\u{1efff}]/u;
/** Unicode's first strong isolate and its end: what `<bdi>` does, for titles, labels and sentences without elements. */
const ISOLATE = '\u2068';
const END = '\u2069';

/**
 * Makes a text from outside safe to show: invisible characters become visible, except those that scripts are
 * written with (`readable`), and right-to-left text can't reorder its surroundings. Call it once for a text: a second call would make the isolates of the first visible.
 */
export function isolated(text: string): string {
  const shown = readable(text);
  return RIGHT_TO_LEFT.test(shown) ? `${ISOLATE}${shown}${END}` : shown;
}

/** The profile's plain name of a joint or sensor in that language ("ko"), ready to show (`isolated`); undefined without
 *  one. */
export function plainName(schema: Schema | null, label: string, language: string): string | undefined {
  const name = schema?.mapping.name(label, language) ?? null;
  return name === null ? undefined : isolated(name);
}

const placesOf = new WeakMap<readonly string[], ReadonlyMap<string, number>>();

/** The index of a name in a list that never changes, or -1. Like `indexOf`, but cached: a loop over all names stays
 *  fast. */
export function placeOf(names: readonly string[], name: string): number {
  let places = placesOf.get(names);
  if (places === undefined) {
    places = new Map(names.map((one, i) => [one, i]));
    placesOf.set(names, places);
  }
  return places.get(name) ?? -1;
}
