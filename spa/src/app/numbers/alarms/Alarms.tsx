import './alarms.css';
import { useCallback, useSyncExternalStore } from 'react';
import { flagWords } from '../../../twin/format.ts';
import { isolated, plainName } from '../../../twin/names.ts';
import { useFaults } from '../../state/fault_keeper.ts';
import { onOwnAlarms, ownAlarms } from '../../state/own_alarms.ts';
import { type RobotLink, useVersion } from '../../state/robot_link.ts';
import { languageTag, useMore } from '../../text/language.ts';
import { edgeWords } from '../../words/fault.ts';
import { OpenFaults, When } from './OpenFaults.tsx';

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
