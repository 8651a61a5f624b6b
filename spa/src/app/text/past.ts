import { korean, useText } from './language.ts';
import { pastEn } from './past/past_en.ts';

/** The sentences of `past_en.ts`, in the language in force. For code outside components; in a component use
 *  `usePastText`. */
export function pastText(): typeof pastEn {
  return korean()?.pastKo ?? pastEn;
}

/** The sentences of `past_en.ts`, in the language in force, for a component. It is drawn again when the language
 *  changes. */
export function usePastText(): typeof pastEn {
  useText();
  return pastText();
}
