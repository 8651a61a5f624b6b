import { type Lack, lacksOf } from '../../twin/balance/lacks.ts';
import { isolated } from '../../twin/names.ts';
import { BALANCE } from '../balance/BalanceParts.tsx';
import { useLatePart } from '../shell/late.tsx';
import { useTicked } from '../state/hooks.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { changeSettings } from '../state/settings.ts';
import { type BalanceText, useBalanceText } from '../text/late.ts';
import { Switch } from './Switch.tsx';

/** The interval between checks for data that is not available yet. */
const EVERY_MS = 250;

/** The menu entry for balance: a switch if at least one of the robots has balance data, and one line for each part that is
 *  unavailable, with the reason. `isDrawn`: whether the view of the body draws its signs. */
export function BalanceEntry({ links, isDrawn }: { links: readonly RobotLink[]; isDrawn: boolean }) {
  const text = useBalanceText();
  const part = useLatePart(BALANCE);
  const shown = useTicked(EVERY_MS, () => {
    if (part === null) return null;
    const watches = links.map((link) => ({ name: link.twin.name, watch: part.balanceOf(link) }));
    const known = watches.flatMap(({ name, watch }) => {
      const found = watch.known();
      return found === null ? [] : [{ name, ...found }];
    });
    if (known.length === 0) return null;
    const lines = known.flatMap(({ name, balance, findings, problems }) =>
      lacksOf(balance, findings, problems).map((lack) =>
        [links.length > 1 ? `${name}: ` : '', lackWords(lack, text)].join(''),
      ),
    );
    const isPossible = known.some(({ possible }) => possible);
    if (isPossible && !isDrawn) lines.unshift(text.onlyIn3d);
    return {
      lines,
      isPossible,
      byItself: watches.some(({ watch }) => watch.isShownByItself),
      isOn: watches.some(({ watch }) => watch.isShown),
    };
  });
  if (shown === null) return null;
  const { lines, isPossible, byItself, isOn } = shown;
  return (
    <div className="sign-entry" data-testid="balance-entry">
      {isPossible ? (
        <Switch
          explain="balance.balance"
          on={isOn}
          onChange={(on) => changeSettings({ balance: on === byItself ? 'auto' : on ? 'on' : 'off' })}
          text={text.balance}
        />
      ) : (
        <span>{text.balance}</span>
      )}
      {lines.map((line) => (
        <p className="quiet" key={line}>
          {line}
        </p>
      ))}
    </div>
  );
}

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
