import './alarms.css';
import { useSyncExternalStore } from 'react';
import type { Fault } from '../../../twin/alarms/fault_log.ts';
import { formatClockSeconds } from '../../../twin/format.ts';
import { isThen } from '../../../twin/liveness.ts';
import { FlagTerm } from '../../explain/FlagTerm.tsx';
import { useNow } from '../../shell/now.ts';
import { pastControls } from '../../state/moment.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { useStore } from '../../state/use_store.ts';
import { more, useMore, useText } from '../../text/language.ts';
import { faultSentence, timesWords } from '../../words/fault_sentence.ts';

/** Playback starts this long before a fault, to show what led up to it. */
const BEFORE_MS = 2000;

const never = () => () => {};

/** When something happened (unix ms by the relay's clock; null if unknown). If the past is kept, it is a button as large as its
 *  row that shows that moment. `title`: the rest of the row's tooltip. */
export function When({ atMs, title }: { atMs: number | null; title?: string | undefined }) {
  const controls = useStore(pastControls);
  const text = useMore();
  const fromMs = useSyncExternalStore(
    controls?.onChange ?? never,
    () => controls?.timeline?.fromMs ?? Number.POSITIVE_INFINITY,
  );
  if (atMs === null) return <time>—</time>;
  const clock = formatClockSeconds(atMs);
  if (atMs < fromMs) return <time>{clock}</time>;
  return (
    <button
      type="button"
      className="text-button when"
      title={title === undefined ? text.lookBack : `${title} · ${text.lookBack}`}
      aria-label={`${text.lookBack}: ${clock}`}
      onClick={() => controls?.seek(atMs - BEFORE_MS)}
    >
      <time>{clock}</time>
    </button>
  );
}

/** The faults that are active or unacknowledged, with their times and a button to acknowledge them. */
export function OpenFaults({ link, faults }: { link: RobotLink; faults: readonly Fault[] }) {
  useNow(1000); // updates how long they have lasted
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
          <When atMs={link.faults.log.occurrences.newestMs(fault.key) ?? fault.firstMs} />
          <span className="alarm-mark" aria-hidden="true" />
          <span className="alarm-words">
            <Told link={link} fault={fault} />
          </span>
          <span className="quiet">{stateWords(fault)}</span>
          {!fault.acknowledged && !isThen(link.watch.word) && (
            <button type="button" className="text-button" onClick={() => link.faults.acknowledge([fault])}>
              {text.acknowledge}
            </button>
          )}
        </li>
      ))}
    </ol>
  );
}

function Told({ link, fault }: { link: RobotLink; fault: Fault }) {
  const { log } = link.faults;
  const nowMs = link.faults.nowMs();
  const { said, code, bit } = faultSentence(link.twin, log, fault, nowMs);
  const times = timesWords(log, fault, nowMs);
  return (
    <>
      {said}{' '}
      <small className="quiet">
        {code} {bit !== null && <FlagTerm source={fault.source} bit={bit} />} {times}
      </small>
    </>
  );
}

function stateWords(fault: Fault): string {
  if (fault.clearedMs !== null) return more().clearedAt(formatClockSeconds(fault.clearedMs));
  return fault.acknowledged ? more().acknowledgedStillThere : more().stillThere;
}
