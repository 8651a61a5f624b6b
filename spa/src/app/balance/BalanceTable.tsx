import { displayOf, formatNumber } from '../../twin/format.ts';
import { useNow } from '../shell/now.ts';
import type { RobotLink } from '../state/robot_link.ts';
import { toggleTrace, useTraces } from '../state/traces.ts';
import { useBalanceText } from '../text/late.ts';
import { VALUES, writeValues } from './balance_traces.ts';
import { balanceOf } from './balance_watch.ts';

/** Numbers that change faster can't be read. */
const EVERY_MS = 250;

/** The numbers of a robot's balance beside those of its sensors; pressing one plots it. Empty while the page does not show
 *  balance. */
export function BalanceTable({ link }: { link: RobotLink }) {
  useNow(EVERY_MS);
  const traces = useTraces();
  const text = useBalanceText();
  const watch = balanceOf(link);
  const { known } = watch;
  if (!watch.isShown || known?.possible !== true || known.balance === null) return null;
  const values = new Float64Array(VALUES.length);
  writeValues(known.balance, values);
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
            const display = displayOf(unit, 'rad');
            return (
              <tr key={label} data-level={label === 'margin' ? known.stance?.level : undefined}>
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
                  {formatNumber(values[i] ?? null, display)}
                </td>
                <td className="unit">{display.unit}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </div>
  );
}
