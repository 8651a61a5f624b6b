import { balanceEn } from './balance/balance_en.ts';
import { korean, useText } from './language.ts';

export type BalanceText = typeof balanceEn;

/** The sentences of `balance_en.ts`, in the language in force. For code outside components; in a component use
 *  `useBalanceText`. */
export function balanceText(): BalanceText {
  return korean()?.balanceKo ?? balanceEn;
}

/** The sentences of `balance_en.ts`, in the language in force, for a component. It is drawn again when the language
 *  changes. */
export function useBalanceText(): BalanceText {
  useText();
  return balanceText();
}
