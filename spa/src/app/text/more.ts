import { korean, useText } from './language.ts';
import { type More, moreEn } from './more_en.ts';

export type { More };

/** The sentences of `more_en.ts`, in the language in force. For code outside components; in a component use `useMore`. */
export function more(): More {
  return korean()?.moreKo ?? moreEn;
}

/** The sentences of `more_en.ts`, in the language in force, for a component. It is drawn again when the language
 *  changes. */
export function useMore(): More {
  useText();
  return more();
}
