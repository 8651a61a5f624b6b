import { korean, useText } from '../../text/language.ts';
import { saveEn } from './save_en.ts';
import { saveKo } from './save_ko.ts';

/** The sentences of the sheet that saves, in the language in force, for a component. It is drawn again when the language
 *  changes. */
export function useSaveText(): typeof saveEn {
  useText();
  return korean() === null ? saveEn : saveKo;
}
