import type { Stance } from '../../twin/balance/stance.ts';
import { type BalanceText, balanceText } from '../text/balance.ts';

/** The sentence about a stance; it says if the stance is assumed. `was`: the pose is from the past or out of date. '' if nothing
 *  is known. */
export function stanceWords(stance: Stance, was: boolean, text: BalanceText = balanceText()): string {
  const { marginMm, assumed } = stance;
  const sentence = sentenceOf(stance, was, text);
  const holds = marginMm !== null && sentence !== '';
  return assumed && holds ? `${sentence} ${text.assumed}` : sentence;
}

/** The text for a missing reading. */
const UNREAD = {
  unread: 'unread',
  'orientation-unread': 'orientationUnread',
  'joint-unread': 'jointUnread',
} as const;

function isUnread(kind: Stance['kind']): kind is keyof typeof UNREAD {
  return kind in UNREAD;
}

function sentenceOf({ kind, marginMm, side }: Stance, was: boolean, text: BalanceText): string {
  if (isUnread(kind)) return was ? '' : text[UNREAD[kind]];
  if (was) return inWords(text[`was${capitalized(kind)}`], marginMm);
  return inWords(text[side ?? (kind === 'outside' ? 'forwards' : kind)], marginMm);
}

/** The same in two or three words, for robots side by side; '' for out-of-date poses. */
export function briefWords({ kind, marginMm }: Stance, was: boolean, text: BalanceText): string {
  if (was) return '';
  return isUnread(kind) ? text.briefUnread : inWords(text[`brief${capitalized(kind)}`], marginMm);
}

function capitalized<T extends string>(kind: T): Capitalize<T> {
  return kind.replace(/./, (first) => first.toUpperCase()) as Capitalize<T>;
}

function inWords(words: string | ((mm: string) => string), marginMm: number | null): string {
  return typeof words === 'string' ? words : words(`${Math.round(Math.abs(marginMm ?? 0))}\u00a0mm`);
}
