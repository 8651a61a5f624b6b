import './balance.css';
import { isOld, isThen } from '../../twin/liveness.ts';
import { useNow } from '../shell/now.ts';
import { useShownSecond } from '../state/moment.ts';
import { type RobotLink, useWord } from '../state/robot_link.ts';
import { useSettings } from '../state/settings.ts';
import { useBalanceText } from '../text/balance.ts';
import { useMore } from '../text/more.ts';
import { balanceOf } from './balance_watch.ts';
import { briefWords, stanceWords } from './stance_words.ts';

/** Numbers that change faster can't be read. */
const EVERY_MS = 250;

/** The sentence about a robot's balance with a mark in the shape and colour of its level; empty while nothing can be said. Old
 *  and past readings are described in the past tense and without a level. */
export function Stood(props: { link: RobotLink; className?: string; brief?: boolean }) {
  const { link, className = '', brief = false } = props;
  useNow(EVERY_MS);
  useShownSecond(); // redraws as the time line moves
  useWord(link); // shows a new state word at once
  useSettings();
  const text = useBalanceText();
  const rest = useMore();
  const watch = balanceOf(link);
  const stance = watch.known?.stance ?? null;
  if (!watch.isShown || stance === null) return null;
  const verdict = link.watch.verdict();
  const old = isOld(verdict);
  const was = old || isThen(verdict.word);
  const words = brief ? briefWords(stance, old, text) : stanceWords(stance, was, text);
  if (words === '') return null;
  return (
    <p
      className={`balance-line ${className}`.trim()}
      data-testid="balance-line"
      data-kind={stance.kind}
      data-level={old ? 'old' : stance.level}
    >
      <i className="balance-mark" aria-hidden="true" />
      <span>{words}</span>
      {!brief && (
        <button
          type="button"
          className="explain-mark"
          data-explain="balance.margin"
          aria-haspopup="dialog"
          aria-label={rest.explainIt(text.balance)}
        >
          ?
        </button>
      )}
    </p>
  );
}

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
