import { korean, useText } from './language.ts';
import { listEn } from './list_en.ts';

/** The list's own sentences, in the language in force: it needs none of the others. */
export function useListText(): typeof listEn {
  useText();
  return korean()?.moreKo ?? listEn;
}
