import { korean, useText } from '../../text/language.ts';
import { saveEn } from './save_en.ts';
import { saveKo } from './save_ko.ts';

/** The texts of the save dialog in the current language, for a component. It is redrawn when the language changes. */
export function useSaveText(): typeof saveEn {
  useText();
  return korean() === null ? saveEn : saveKo;
}
