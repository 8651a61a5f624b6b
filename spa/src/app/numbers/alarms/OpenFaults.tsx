import './alarms.css';
import type { Fault } from '../../../twin/alarms/fault_log.ts';
import { formatClockSeconds } from '../../../twin/format.ts';
import { isolated, plainName } from '../../../twin/names.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { faultWords } from '../../status/fault_words.ts';
import { useText } from '../../text/language.ts';
import { more, useMore } from '../../text/more.ts';

/** The faults that are not acknowledged or not over, with their times and a button to acknowledge them. */
export function OpenFaults({
  link,
  faults,
  named,
}: {
  link: RobotLink;
  faults: readonly Fault[];
  /** Whether each fault names its joint or sensor. */
  named: boolean;
}) {
  const text = useText();
  const rest = useMore();
  if (faults.length === 0) return null;
  return (
    <ol className="alarms open-faults" data-testid="open-faults" aria-label={rest.faults}>
      {faults.map((fault) => (
        <li
          key={fault.key}
          data-level={fault.level}
          data-state={fault.clearedMs === null ? 'on' : 'off'}
          data-acknowledged={fault.acknowledged}
        >
          <time>{formatClockSeconds(fault.firstMs)}</time>
          <span className="alarm-mark" aria-hidden="true" />
          <span className="alarm-words">
            {named && <b title={plainName(link.twin.schema, fault.source)}>{isolated(fault.source)} </b>}
            {faultWords(fault)}
          </span>
          <span className="quiet">{stateWords(fault)}</span>
          {!fault.acknowledged && (
            <button type="button" className="text-button" onClick={() => link.faults.acknowledge([fault])}>
              {text.acknowledge}
            </button>
          )}
        </li>
      ))}
    </ol>
  );
}

function stateWords(fault: Fault): string {
  if (fault.clearedMs !== null) return more().clearedAt(formatClockSeconds(fault.clearedMs));
  return fault.acknowledged ? more().acknowledgedStillThere : more().stillThere;
}
