import { RIGHT_TO_LEFT, type Schema, visible } from '@posecast/wire';

/** Unicode's first strong isolate and its end: the equivalent of `<bdi>` for titles, labels and sentences without elements. */
const ISOLATE = '\u2068';
const END = '\u2069';

/**
 * Makes an external text safe to show: invisible characters become `visible`, except those needed by scripts, and right-to-left
 * text can't reorder its surroundings. Call it only once per text: a second call would make the first one's
 * isolates visible.
 */
export function isolated(text: string): string {
  return alone(visible(text));
}

/** The same for a text that is `visible` already. */
export function alone(shown: string): string {
  return RIGHT_TO_LEFT.test(shown) ? `${ISOLATE}${shown}${END}` : shown;
}

/** A text that is made of isolated ones, as one that can be isolated as a whole. */
export function withoutIsolates(shown: string): string {
  return shown.replaceAll(ISOLATE, '').replaceAll(END, '');
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
