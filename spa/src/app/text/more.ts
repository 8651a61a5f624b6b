import { korean, useText } from './language.ts';
import { type More, moreEn } from './more_en.ts';

/** The sentences of what comes when it is wanted, in the language in force. */
export function more(): More {
  return korean()?.moreKo ?? moreEn;
}

/** The same in a component, which is drawn again when the language changes. */
export function useMore(): More {
  useText();
  return more();
}
