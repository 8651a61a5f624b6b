import { korean, useText } from './language.ts';
import { type Moments, momentsEn } from './moments/moments_en.ts';

/** The sentences of `moments_en.ts`, in the language in force, for a component. It is drawn again when the language
 *  changes. */
export function useMomentsText(): Moments {
  useText();
  return korean()?.momentsKo ?? momentsEn;
}
