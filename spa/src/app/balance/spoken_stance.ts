import type { RobotLink } from '../state/robot_link.ts';
import { balanceOf } from './balance_watch.ts';
import { stanceWords } from './stance_words.ts';

/** The sentence about a robot's balance for screen readers. `gist` changes only with the level or the direction, not with the
 *  number. null while the page does not show balance, or balance is unknown. */
export function spokenStance(link: RobotLink): { text: string; gist: string } | null {
  const watch = balanceOf(link);
  const stance = watch.known?.stance ?? null;
  if (!watch.isShown || stance === null) return null;
  const { kind, level, side, assumed } = stance;
  const standing = kind === 'inside' || kind === 'edge' ? '' : kind;
  return {
    text: stanceWords(stance, false),
    gist: ['balance', level, standing, side, assumed].join(' '),
  };
}
