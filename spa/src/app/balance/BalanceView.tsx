import { displayOf, formatNumber } from '../../twin/format.ts';
import { Tucked } from '../shell/Tucked.tsx';
import { useTicked } from '../state/hooks.ts';
import { type RobotLink, useWord } from '../state/robot_link.ts';
import { toggleTrace, useShownSecond, useTraces } from '../state/viewing.ts';
import { type BalanceText, balanceText, useBalanceText } from '../text/late.ts';
import { balanceOf, stanceShown, VALUES, writeValues } from './balance_watch.ts';
import './balance.css';

import type { Stance } from '../../twin/balance/stance.ts';
import { isOld, isThen } from '../../twin/liveness.ts';
import { useSettings } from '../state/settings.ts';
import { useMore } from '../text/language.ts';

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
export function Stood(props: { link: RobotLink; className?: string; brief?: boolean; tucked?: boolean }) {
  const { link, className = '', brief = false, tucked = false } = props;
  useShownSecond(); // redraws as the time line moves
  useWord(link); // shows a new state word at once
  useSettings();
  const text = useBalanceText();
  const rest = useMore();
  const watch = balanceOf(link);
  const { kind, level, words, few } = useTicked(EVERY_MS, () => {
    const stance = stanceShown(link);
    if (!watch.isShown || stance === null) return { words: '' };
    const verdict = link.watch.verdict();
    const old = isOld(verdict);
    const words = brief
      ? briefWords(stance, old, text)
      : stanceWords(stance, old || isThen(verdict.word), text);
    const few = briefWords(stance, false, text);
    return { kind: stance.kind, level: old ? 'old' : stance.level, words, few };
  });
  if (words === '') return null;
  const mark = <i className="balance-mark" data-kind={kind} data-level={level} aria-hidden="true" />;
  const line = (
    <p
      className={`balance-line ${className}`.trim()}
      data-testid="balance-line"
      data-kind={kind}
      data-level={level}
    >
      {mark}
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
  if (!tucked) return line;
  return (
    <Tucked
      className="balance-tucked"
      brief={
        <>
          {mark}
          {few}
        </>
      }
    >
      {line}
    </Tucked>
  );
}

/** The sentence about a robot's balance for screen readers. `gist` changes only with the level or the direction, not with the
 *  number. null while the page does not show balance, or balance is unknown. */
export function spokenStance(link: RobotLink): { text: string; gist: string } | null {
  const watch = balanceOf(link);
  const stance = watch.known()?.stance ?? null;
  if (!watch.isShown || stance === null) return null;
  const { kind, level, side, assumed } = stance;
  const standing = kind === 'inside' || kind === 'edge' ? '' : kind;
  return {
    text: stanceWords(stance, false),
    gist: ['balance', level, standing, side, assumed].join(' '),
  };
}

/** The numbers of a robot's balance beside those of its sensors; pressing one plots it. Empty while the page does not show
 *  balance. */
export function BalanceTable({ link }: { link: RobotLink }) {
  const traces = useTraces();
  const text = useBalanceText();
  const watch = balanceOf(link);
  const shown = useTicked(EVERY_MS, () => {
    const known = watch.known();
    if (!watch.isShown || known?.possible !== true || known.balance === null) return null;
    const values = new Float64Array(VALUES.length);
    writeValues(known.balance, values);
    const words = VALUES.map(({ unit }, i) => formatNumber(values[i] ?? null, displayOf(unit, 'rad')));
    return { words, level: known.stance?.level };
  });
  if (shown === null) return null;
  return (
    <div className="sensors" data-testid="balance-table">
      <table className="sensor balance-table">
        <caption>
          {text.balance}
          <button
            type="button"
            className="term kind"
            data-explain="balance.balance"
            aria-haspopup="dialog"
            aria-label={text.balanceWhat}
          >
            ?
          </button>
        </caption>
        <tbody>
          {VALUES.map((value, i) => {
            const { field, label, name, unit } = value;
            return (
              <tr key={label} data-level={label === 'margin' ? shown.level : undefined}>
                <th scope="row">
                  <button
                    type="button"
                    title={text.toPlots}
                    aria-pressed={traces.some((one) => one.field === field && one.label === label)}
                    data-testid={`plot-${label}`}
                    onClick={() => toggleTrace(value)}
                  >
                    {text[name]}
                  </button>
                </th>
                <td className="c-num" data-field={field} data-label={label} draggable>
                  {shown.words[i]}
                </td>
                <td className="unit">{displayOf(unit, 'rad').unit}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </div>
  );
}
