import { korean, useText } from './language.ts';
import { presentEn } from './present_en.ts';

/** The sentences of `present_en.ts`, in the language in force, for a component. It is drawn again when the language
 *  changes. */
export function usePresentText(): typeof presentEn {
  useText();
  return korean()?.presentKo ?? presentEn;
}
