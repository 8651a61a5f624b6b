import type { Schema, Sentence } from '@posecast/wire';

/**
 * Fills the placeholders of a sentence, such as `{joint}`. `textOf` returns the text for a placeholder, or null if unknown. A
 * part in brackets with an unknown placeholder is left out; elsewhere the placeholder becomes "—".
 */
export function fillSentence(say: string, textOf: (place: string) => string | null): string {
  const parts = say.split(/\[([^[\]]*)\]/); // every other part was in brackets
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
 * The robot profile's description of one flag bit: in the language with this tag ("ko"), else in its base language, else in
 * English or any available one. null if there is none.
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
