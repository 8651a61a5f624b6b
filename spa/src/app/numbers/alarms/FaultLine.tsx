import { Fragment } from 'react';
import { LatePart } from '../../../browser/late_part.ts';
import { firstPaint } from '../../../browser/painting.ts';
import { canKnowFaults, type Fault } from '../../../twin/alarms/fault_log.ts';
import { formatSpan } from '../../../twin/format.ts';
import { isThen } from '../../../twin/liveness.ts';
import { isolated } from '../../../twin/names.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import { FlagTerm } from '../../explain/terms.tsx';
import { useLatePart } from '../../shell/late.tsx';
import { useFaults } from '../../state/fault_keeper.ts';
import { useTicked } from '../../state/hooks.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { selectJoint } from '../../state/viewing.ts';
import { say, useText } from '../../text/language.ts';
import { faultWords } from '../../words/fault.ts';

/** Turns faults into sentences; loaded once the body is drawn. Until then, the line shows the robot's own words. */
const SENTENCES = new LatePart(() => firstPaint().then(() => import('../../words/fault_sentence.ts')));

/** The faults in one line above the tabs; on a phone it stays visible when the sheet is down. `onMore` shows all of them. */
export function FaultLine({ link, onMore }: { link: RobotLink; onMore: () => void }) {
  const text = useText();
  const sentences = useLatePart(SENTENCES);
  const faults = useFaults(link.faults);
  const open = faults?.filter((fault) => !fault.acknowledged) ?? [];
  const counted = open.filter(({ level }) => level === 'fault').length;
  const first = open[0];
  const told = useTicked(500, () => {
    if (first === undefined) return null;
    const { log } = link.faults;
    const nowMs = link.faults.nowMs();
    const sentence = sentences?.faultSentence(link.twin, log, first, nowMs) ?? null;
    return {
      said: sentence?.said ?? `${isolated(first.source)} ${faultWords(first)}`,
      code: sentence?.code,
      bit: sentence?.bit,
      when: sentence?.aged
        ? ''
        : whenWords(first, log.occurrences.newestMs(first.key) ?? first.firstMs, nowMs),
      times: sentences?.timesWords(log, first, nowMs),
    };
  });
  if (told === null || first === undefined)
    return (
      <div className="fault-line" data-testid="fault-line" data-faults={faults === null ? undefined : 0}>
        <span className="quiet">{faults === null ? '' : quietWords(link.twin, faults)}</span>
      </div>
    );
  const { said, code, bit, when, times } = told;
  const details = [code, bit && <FlagTerm source={first.source} bit={bit} />, when, times].filter(Boolean);
  const acknowledge = open.length > 1 ? text.acknowledgeAll : text.acknowledge;
  return (
    <div className="fault-line" data-testid="fault-line" data-faults={counted} data-told={sentences !== null}>
      <span
        className="fault-mark"
        data-level={first.level}
        data-over={first.clearedMs !== null}
        aria-hidden="true"
      />
      <button type="button" className="fault-what" title={said} onClick={() => selectJoint(first.source)}>
        {said}
      </button>
      <span className="quiet fault-small">
        {details.map((detail, i) => (
          <Fragment key={typeof detail === 'string' ? detail : 'bit'}>
            {i > 0 && ' · '}
            {typeof detail === 'string' ? <span className="fault-words">{detail}</span> : detail}
          </Fragment>
        ))}
      </span>
      {open.length > 1 && (
        <button type="button" className="text-button more" title={text.alarms} onClick={onMore}>
          {text.moreAlarms(open.length - 1)}
        </button>
      )}
      {!isThen(link.watch.word) && (
        <button
          type="button"
          className="text-button acknowledge"
          data-testid="acknowledge"
          aria-label={acknowledge}
          title={acknowledge}
          onClick={() => link.faults.acknowledge(open)}
        >
          <span>{acknowledge}</span>
        </button>
      )}
    </div>
  );
}

function quietWords({ schema, limits }: RobotTwin, faults: readonly Fault[]): string {
  const count = faults.filter(({ level }) => level === 'fault').length;
  if (count > 0) return say().faultsAcknowledged(count);
  return schema !== null && limits !== null && canKnowFaults(schema, limits)
    ? say().noFaults
    : say().noFaultsReported;
}

function whenWords(fault: Fault, newestMs: number, nowMs: number): string {
  if (fault.clearedMs !== null)
    return say().clearedAgo(formatSpan(Math.max(1000, whole(nowMs - fault.clearedMs))));
  const lastsMs = nowMs - newestMs;
  return lastsMs < 1000 ? say().now : formatSpan(whole(lastsMs));
}

function whole(ms: number): number {
  return Math.floor(Math.max(ms, 0) / 1000) * 1000;
}
