import type { Fault } from '../../../twin/alarms/fault_log.ts';
import { coarseDisplay, displayOf, formatNumber, formatSpan } from '../../../twin/format.ts';
import { isolated, plainName } from '../../../twin/names.ts';
import { useNow } from '../../shell/now.ts';
import { useFaults } from '../../state/fault_keeper.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { selectJoint } from '../../state/selection.ts';
import { settings } from '../../state/settings.ts';
import { faultWords } from '../../status/fault_words.ts';
import { say, useText } from '../../text/language.ts';

/** The faults in one line above the tabs; on a phone it stays visible when the sheet is down. */
export function FaultLine({ link }: { link: RobotLink }) {
  useNow(500); // how long it has lasted
  const text = useText();
  const faults = useFaults(link.faults);
  const open = faults?.filter((fault) => !fault.acknowledged) ?? [];
  const counted = open.filter(({ level }) => level === 'fault').length;
  const first = open[0];
  return (
    <div className="fault-line" data-testid="fault-line" data-faults={faults === null ? undefined : counted}>
      {first === undefined ? (
        <span className="quiet">{faults === null ? '' : quietWords(faults)}</span>
      ) : (
        <>
          <span
            className="fault-mark"
            data-level={first.level}
            data-over={first.clearedMs !== null}
            aria-hidden="true"
          />
          <button
            type="button"
            className="fault-what"
            title={plainName(link.twin.schema, first.source)}
            onClick={() => selectJoint(first.source)}
          >
            <b>{isolated(first.source)}</b> {faultWords(first, offBy(link, first))}
          </button>
          <span className="quiet">· {whenWords(first)}</span>
          {open.length > 1 && <span className="quiet more">+{open.length - 1}</span>}
          <button
            type="button"
            className="text-button acknowledge"
            data-testid="acknowledge"
            onClick={() => link.faults.acknowledge(open)}
          >
            {open.length > 1 ? text.acknowledgeAll : text.acknowledge}
          </button>
        </>
      )}
    </div>
  );
}

function quietWords(faults: readonly Fault[]): string {
  const count = faults.filter(({ level }) => level === 'fault').length;
  return count === 0 ? say().noFaults : say().faultsAcknowledged(count);
}

/** How far a joint is off its command now: "0.21 rad". */
function offBy({ twin }: RobotLink, { what, source }: Fault): string {
  const [ref, pos] = [twin.value('ref', source) ?? null, twin.value('pos', source) ?? null];
  if (what !== 'apart' || ref === null || pos === null) return '';
  const field = twin.schema?.field('pos');
  const unit = twin.schema?.mapping.unit('pos', source) ?? field?.unit ?? '';
  const display = displayOf(unit, settings().angle, field?.scale);
  return `${formatNumber(Math.abs(ref - pos), coarseDisplay(display)).trim()} ${display.unit}`;
}

function whenWords(fault: Fault): string {
  if (fault.clearedMs !== null) return say().overSince(formatSpan(whole(Date.now() - fault.clearedMs)));
  const lastsMs = Date.now() - fault.firstMs;
  return lastsMs < 1000 ? say().now : formatSpan(whole(lastsMs));
}

function whole(ms: number): number {
  return Math.floor(Math.max(ms, 0) / 1000) * 1000;
}
