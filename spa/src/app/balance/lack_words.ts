import type { Lack } from '../../twin/balance/lacks.ts';
import { isolated } from '../../twin/names.ts';
import type { BalanceText } from '../text/late.ts';

const WHY = {
  raw: 'rawModel',
  unreadable: 'builtBefore',
  'old-bundle': 'builtBefore',
  'no-masses': 'noMasses',
  'impossible-masses': 'impossibleMasses',
  'no-feet': 'noFeet',
  'no-wrench': 'noForce',
  'no-pressure': 'noPressure',
  'orientation-unread': 'orientationUnread',
  'joint-unread': 'jointUnread',
} as const;

/** Why a part of balance is unknown, in one line. */
export function lackWords({ why, told }: Lack, text: BalanceText): string {
  return told === undefined ? text[WHY[why]] : isolated(told);
}
