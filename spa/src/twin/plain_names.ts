import type { Schema } from '@posecast/wire';

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
