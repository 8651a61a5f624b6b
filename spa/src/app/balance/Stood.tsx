import './balance.css';
import type { Stance } from '../../twin/balance/stance.ts';
import { isOld, isThen } from '../../twin/liveness.ts';
import { useNow } from '../shell/now.ts';
import { useShownSecond } from '../state/moment.ts';
import { type RobotLink, useWord } from '../state/robot_link.ts';
import { useSettings } from '../state/settings.ts';
import { useMore } from '../text/language.ts';
import { type BalanceText, balanceText, useBalanceText } from '../text/late.ts';
import { balanceOf } from './balance_watch.ts';

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
