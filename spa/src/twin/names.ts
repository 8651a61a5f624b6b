import { readable, type Schema } from '@posecast/wire';

/** Right-to-left letters and marks. */
const RIGHT_TO_LEFT =
  /[\u200f\u0590-\u08ff\ufb1d-\ufdff\ufe70-\ufefc\u{10800}-\u{10fff}\u{1e800}-\u{1efff}]/u;
/** Unicode's first strong isolate and its end: the equivalent of `<bdi>` for titles, labels and sentences without elements. */
const ISOLATE = '\u2068';
const END = '\u2069';

/**
 * Makes an external text safe to show: invisible characters become visible, except those needed by scripts (`readable`), and
 * right-to-left text can't reorder its surroundings. Call it only once per text: a second call would make the first one's
 * isolates visible.
 */
export function isolated(text: string): string {
  const shown = readable(text);
  return RIGHT_TO_LEFT.test(shown) ? `${ISOLATE}${shown}${END}` : shown;
}

/** The profile's plain name of a joint or sensor in that language ("ko"), safe to show (`isolated`); undefined if there is
 *  none. */
export function plainName(schema: Schema | null, label: string, language: string): string | undefined {
  const name = schema?.mapping.name(label, language) ?? null;
  return name === null ? undefined : isolated(name);
}

/** Identifies a fault among those of a robot: its source and its text. No name holds a control character. */
export function causeOf({ source, text }: { readonly source: string; readonly text: string }): string {
  return `${source}\n${text}`;
}

const placesOf = new WeakMap<readonly string[], ReadonlyMap<string, number>>();

/** The index of a name in a list that never changes, or -1. Like `indexOf`, but cached, so that a loop over all names stays
 *  fast. */
export function placeOf(names: readonly string[], name: string): number {
  let places = placesOf.get(names);
  if (places === undefined) {
    places = new Map(names.map((one, i) => [one, i]));
    placesOf.set(names, places);
  }
  return places.get(name) ?? -1;
}

/**
 * The plain name of a joint or sensor, not yet `isolated`: the profile's words in that language ("right knee"; or those without a
 * language tag), else the words of a name made of words (`left_hip_pitch_joint`, "left hip pitch"); null for a code (`RKN`).
 */
export function wordsOfName(schema: Schema | null, label: string, language: string): string | null {
  return schema?.mapping.name(label, language) ?? spelledOut(label);
}

function spelledOut(label: string): string | null {
  const words = label
    .replace(/(\p{Ll})(\p{Lu})/gu, '$1 $2')
    .split(/[\s_.\-/]+/u)
    .filter((word) => word !== '');
  if (words.length > 1 && /^joint$/i.test(words.at(-1)!)) words.pop();
  // Codes have no small letters; a word has more than one.
  if (words.length < 2 || !words.some((word) => /\p{Ll}{2}/u.test(word))) return null;
  return words.map((word) => (/^\p{Lu}\p{Ll}/u.test(word) ? word.toLowerCase() : word)).join(' ');
}
