import { korean, useText } from './language.ts';
import { listEn } from './list_en.ts';

/** The sentences of the robot list, in the language in force. They have a file of their own, so that the list loads less.
 *  The component is drawn again when the language changes. */
export function useListText(): typeof listEn {
  useText();
  return korean()?.moreKo ?? listEn;
}
