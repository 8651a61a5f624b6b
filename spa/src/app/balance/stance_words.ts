import type { Stance } from '../../twin/balance/told/stance.ts';
import { type BalanceText, balanceText } from '../text/balance.ts';

/** The sentence about a stance, with whether it is assumed. `was`: of a pose that is no longer the robot's own, or of then;
 *  '' where nothing can be said. */
export function stanceWords(stance: Stance, was: boolean, text: BalanceText = balanceText()): string {
  const { marginMm, assumed } = stance;
  const sentence = sentenceOf(stance, was, text);
  const holds = marginMm !== null && sentence !== '';
  return assumed && holds ? `${sentence} ${text.assumed}` : sentence;
}

/** What is said of each kind, what once it is no longer so, and what beside other robots. */
const SAID = {
  inside: ['inside', 'wasInside', 'briefInside'],
  edge: ['edge', 'wasEdge', 'briefEdge'],
  moving: ['moving', 'wasOutside', 'briefMoving'],
  outside: ['forwards', 'wasOutside', 'briefOutside'],
  airborne: ['airborne', 'wasAirborne', 'briefAirborne'],
  unread: ['unread', null, 'briefUnread'],
  'orientation-unread': ['orientationUnread', null, 'briefUnread'],
  'joint-unread': ['jointUnread', null, 'briefUnread'],
} as const;

function sentenceOf({ kind, marginMm, side }: Stance, was: boolean, text: BalanceText): string {
  const [is, before] = SAID[kind];
  const name = was ? before : (side ?? is);
  return name === null ? '' : inWords(text[name], marginMm);
}

/** The same in two or three words, beside other robots; '' for what is old. */
export function briefWords({ kind, marginMm }: Stance, was: boolean, text: BalanceText): string {
  return was ? '' : inWords(text[SAID[kind][2]], marginMm);
}

function inWords(words: string | ((mm: string) => string), marginMm: number | null): string {
  return typeof words === 'string' ? words : words(`${Math.round(Math.abs(marginMm ?? 0))}\u00a0mm`);
}
