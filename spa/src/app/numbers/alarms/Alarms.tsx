import './alarms.css';
import { useCallback, useSyncExternalStore } from 'react';
import type { Fault } from '../../../twin/alarms/fault_log.ts';
import { flagWords, formatClockSeconds } from '../../../twin/format.ts';
import { isThen } from '../../../twin/liveness.ts';
import { isolated, plainName } from '../../../twin/names.ts';
import { FlagTerm } from '../../explain/terms.tsx';
import { useFaults } from '../../state/fault_keeper.ts';
import { useStore, useTicked } from '../../state/hooks.ts';
import { onOwnAlarms, ownAlarms } from '../../state/own_alarms.ts';
import { type RobotLink, useVersion } from '../../state/robot_link.ts';
import { pastControls } from '../../state/viewing.ts';
import { languageTag, more, useMore, useText } from '../../text/language.ts';
import { edgeWords } from '../../words/fault.ts';
import { faultSentence, timesWords } from '../../words/fault_sentence.ts';

/** One entry of the list of events. */
interface Happened {
  readonly key: string;
  /** Unix, ms; null if the relay did not send it. */
  readonly atMs: number | null;
  readonly level: string;
  readonly state: string;
  readonly source: string;
  readonly title: string | undefined;
  readonly words: string;
  readonly own: boolean;
}

/** The open faults, then past events, newest first: the relay's last hundred, and those of the viewer's own limits. */
export function Alarms({ link }: { link: RobotLink }) {
  const { twin } = link;
  useVersion(link);
  const text = useMore();
  const faults = useFaults(link.faults) ?? [];
  const subscribe = useCallback((listener: () => void) => onOwnAlarms(twin, listener), [twin]);
  const crossings = useSyncExternalStore(subscribe, () => ownAlarms(twin));
  const { events, schema } = twin;
  const told: Happened[] = events.map(({ n, at, level, state, source, text: said }) => ({
    key: `event ${n}`,
    atMs: at === null ? null : at * 1000,
    source: isolated(source),
    title: plainName(schema, source, languageTag()),
    words: edgeWords(source, flagWords(said)),
    own: false,
    ...{ level, state },
  }));
  const seen: Happened[] = crossings.map(({ n, atMs, source, state, side, limit, own }) => ({
    key: `own ${n}`,
    words: text[side](limit),
    level: 'fault',
    title: undefined,
    ...{ atMs, source, state, own },
  }));
  const all = [...told, ...seen].toReversed().sort((a, b) => (b.atMs ?? 0) - (a.atMs ?? 0));
  if (all.length === 0 && faults.length === 0)
    return twin.hasAllEvents && <p className="note">{text.nothingHappened}</p>;
  return (
    <>
      <OpenFaults link={link} faults={faults} />
      <ol className="alarms" data-testid="alarms" aria-label={text.whatHappened}>
        {all.map(({ key, atMs, level, state, source, title, words, own }) => (
          <li key={key} data-level={level} data-state={state} data-own={own}>
            <When atMs={atMs} title={title} />
            <span className="alarm-mark" aria-hidden="true" />
            <span className="alarm-words">
              <b title={title}>{source}</b> {words}
            </span>
            <span className="quiet">
              {[own ? text.yourLimit : '', state === 'off' ? text.cleared : ''].join(' ')}
            </span>
          </li>
        ))}
      </ol>
    </>
  );
}

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
  const text = useText();
  const rest = useMore();
  const told = useTicked(1000, () => {
    const { log } = link.faults;
    const nowMs = link.faults.nowMs();
    return faults.map((fault) => ({
      ...faultSentence(link.twin, log, fault, nowMs),
      times: timesWords(log, fault, nowMs),
    }));
  });
  if (faults.length === 0) return null;
  return (
    <ol className="alarms open-faults" data-testid="open-faults" aria-label={rest.faults}>
      {faults.map((fault, i) => (
        <li
          key={fault.key}
          data-level={fault.level}
          data-state={fault.clearedMs === null ? 'on' : 'off'}
          data-acknowledged={fault.acknowledged}
        >
          <When atMs={link.faults.log.occurrences.newestMs(fault.key) ?? fault.firstMs} />
          <span className="alarm-mark" aria-hidden="true" />
          <span className="alarm-words">
            {told[i]!.said}{' '}
            <small className="quiet">
              {told[i]!.code} {told[i]!.bit !== null && <FlagTerm source={fault.source} bit={told[i]!.bit} />}{' '}
              {told[i]!.times}
            </small>
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

function stateWords(fault: Fault): string {
  if (fault.clearedMs !== null) return more().clearedAt(formatClockSeconds(fault.clearedMs));
  return fault.acknowledged ? more().acknowledgedStillThere : more().stillThere;
}
