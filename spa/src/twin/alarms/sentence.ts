import type { Schema, Sentence } from '@posecast/wire';

/**
 * Fills the places of a sentence, `{joint}`. `textOf` gives the text of a place, or null where it is unknown: a part in
 * brackets that has such a place is left out, and elsewhere the place reads "—".
 */
export function fillSentence(say: string, textOf: (place: string) => string | null): string {
  const parts = say.split(/\[([^[\]]*)\]/); // every other one stood in brackets
  return parts
    .map((part, i) => {
      let whole = true;
      const filled = part.replace(/\{(\w{1,20})\}/g, (_, place: string) => {
        const value = textOf(place);
        whole &&= value !== null;
        return value ?? '—';
      });
      return whole || i % 2 === 0 ? filled : '';
    })
    .join('');
}

/**
 * What the robot's profile says of a bit of one of its parts: in the language of that tag ("ko"), else of its first part,
 * else in English or whatever there is. null where it says nothing.
 */
export function sentenceOf(
  schema: Schema | null,
  source: string,
  bit: string,
  language: string,
): Sentence | null {
  const of = schema?.fields.find(({ bits, labels }) => bits.includes(bit) && labels.includes(source));
  const told = of === undefined ? null : (schema?.mapping.sentence(of.name, bit) ?? null);
  if (told === null) return null;
  const [first] = told.values();
  return told.get(language) ?? told.get(language.split('-')[0]!) ?? told.get('en') ?? first ?? null;
}
