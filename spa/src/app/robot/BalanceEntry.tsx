import { lacksOf } from '../../twin/balance/lacks.ts';
import { BALANCE } from '../balance/BalanceParts.tsx';
import { lackWords } from '../balance/lack_words.ts';
import { useLatePart } from '../shell/late.tsx';
import { useNow } from '../shell/now.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { changeSettings } from '../state/settings.ts';
import { useBalanceText } from '../text/late.ts';
import { Switch } from './Switch.tsx';

/** The interval between checks for data that is not available yet. */
const EVERY_MS = 250;

/** The menu entry for balance: a switch if at least one of the robots has balance data, and one line for each part that is
 *  unavailable, with the reason. `isDrawn`: whether the view of the body draws its signs. */
export function BalanceEntry({ links, isDrawn }: { links: readonly RobotLink[]; isDrawn: boolean }) {
  useNow(EVERY_MS);
  const text = useBalanceText();
  const part = useLatePart(BALANCE);
  if (part === null) return null;
  const watches = links.map((link) => ({ name: link.twin.name, watch: part.balanceOf(link) }));
  const known = watches.flatMap(({ name, watch }) =>
    watch.known === null ? [] : [{ name, ...watch.known }],
  );
  if (known.length === 0) return null;
  const lines = known.flatMap(({ name, balance, findings, problems }) =>
    lacksOf(balance, findings, problems).map((lack) =>
      [links.length > 1 ? `${name}: ` : '', lackWords(lack, text)].join(''),
    ),
  );
  const isPossible = known.some(({ possible }) => possible);
  if (isPossible && !isDrawn) lines.unshift(text.onlyIn3d);
  const byItself = watches.some(({ watch }) => watch.isShownByItself);
  return (
    <div className="sign-entry" data-testid="balance-entry">
      {isPossible ? (
        <Switch
          explain="balance.balance"
          on={watches.some(({ watch }) => watch.isShown)}
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
