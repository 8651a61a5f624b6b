import { type Schema, visible } from '@posecast/wire';

/** Letters that are written from right to left. */
const RIGHT_TO_LEFT = /[\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc\u{10800}-\u{10fff}\u{1e800}-\u{1efff}]/u;
/** First strong isolate, and its end: `<bdi>` for titles, labels and sentences, which have no elements. */
const ISOLATE = '\u2068';
const END = '\u2069';

/**
 * A text from outside as the page shows it, wherever that is: what is unseen in it is made visible, and its direction is its own.
 * Once only: the second time makes the first one visible.
 */
export function isolated(text: string): string {
  const shown = visible(text);
  return RIGHT_TO_LEFT.test(shown) ? `${ISOLATE}${shown}${END}` : shown;
}

/** What the profile calls a joint or a sensor, as the page shows it. */
export function plainName(schema: Schema | null, label: string): string | undefined {
  const name = schema?.mapping.names.get(label);
  return name === undefined ? undefined : isolated(name);
}

const placesOf = new WeakMap<readonly string[], ReadonlyMap<string, number>>();

/** Where a name stands in a list that does not change; -1: nowhere. Like `indexOf`, of which a loop over all names would be slow. */
export function placeOf(names: readonly string[], name: string): number {
  let places = placesOf.get(names);
  if (places === undefined) {
    places = new Map(names.map((one, i) => [one, i]));
    placesOf.set(names, places);
  }
  return places.get(name) ?? -1;
}
