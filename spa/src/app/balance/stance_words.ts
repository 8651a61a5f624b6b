import type { Lack } from '../../twin/balance/told/lacks.ts';
import type { Stance } from '../../twin/balance/told/stance.ts';
import { isolated } from '../../twin/names.ts';
import { type BalanceText, balanceText } from '../text/balance.ts';

/** The sentence about a stance, with whether it is assumed. `was`: of a pose that is no longer the robot's own, or of then;
 *  '' where nothing can be said. */
export function stanceWords(stance: Stance, was: boolean, text: BalanceText = balanceText()): string {
  const { kind, assumed } = stance;
  const sentence = sentenceOf(stance, was, text);
  const holds = kind !== 'airborne' && kind !== 'unread' && sentence !== '';
  return assumed && holds ? `${sentence} ${text.assumed}` : sentence;
}

function sentenceOf({ kind, marginMm, side }: Stance, was: boolean, text: BalanceText): string {
  const mm = shown(marginMm);
  switch (kind) {
    case 'inside':
      return was ? text.wasInside(mm) : text.inside(mm);
    case 'edge':
      return was ? text.wasEdge : text.edge;
    case 'moving':
      return was ? text.wasOutside(mm) : text.moving(mm);
    case 'outside':
      return was ? text.wasOutside(mm) : text[side ?? 'forwards'](mm);
    case 'airborne':
      return was ? text.wasAirborne : text.airborne;
    case 'unread':
      return was ? '' : text.unread;
  }
}

/** The same in two or three words, beside other robots; '' for what is old. */
export function briefWords({ kind, marginMm }: Stance, was: boolean, text: BalanceText): string {
  if (was) return '';
  const mm = shown(marginMm);
  switch (kind) {
    case 'inside':
      return text.briefInside(mm);
    case 'edge':
      return text.briefEdge;
    case 'outside':
      return text.briefOutside(mm);
    case 'moving':
      return text.briefMoving(mm);
    case 'airborne':
      return text.briefAirborne;
    case 'unread':
      return text.briefUnread;
  }
}

function shown(marginMm: number | null): string {
  return `${Math.round(Math.abs(marginMm ?? 0))}\u00a0mm`;
}

const WHY = {
  raw: 'rawModel',
  unreadable: 'builtBefore',
  'old-bundle': 'builtBefore',
  'no-masses': 'noMasses',
  'impossible-masses': 'impossibleMasses',
  'no-feet': 'noFeet',
} as const;

/** Why a part of balance can't be known, in one line. */
export function lackWords({ why, told }: Lack, text: BalanceText): string {
  return told === undefined ? text[WHY[why]] : isolated(told);
}
