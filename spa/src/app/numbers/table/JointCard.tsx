import './joint_card.css';
import { useEffect, useRef } from 'react';
import { flagWords, formatClockSeconds } from '../../../twin/format.ts';
import { isolated, wordsOfName } from '../../../twin/names.ts';
import { FlagTerm } from '../../explain/FlagTerm.tsx';
import { BackIcon, IconButton } from '../../shell/icons.tsx';
import { useNow } from '../../shell/now.ts';
import { usePageKeys } from '../../shell/page_keys.ts';
import { refreshWith } from '../../shell/refresh.ts';
import { useFaults } from '../../state/fault_keeper.ts';
import { type RobotLink, useVersion } from '../../state/robot_link.ts';
import { selection, selectJoint } from '../../state/selection.ts';
import { useSettings } from '../../state/settings.ts';
import { onTraces } from '../../state/traces.ts';
import { languageTag, onLanguage, useMore } from '../../text/language.ts';
import { OpenFaults } from '../alarms/OpenFaults.tsx';
import { JointRoom } from './JointRoom.tsx';
import { JointCardView } from './joint_card_view.ts';

const EVENTS_SHOWN = 8;
/** The card is redrawn this often even without new frames, because the time axis moves. */
const SLIDES_EVERY_MS = 500;

/** The card with everything about one joint; Escape closes it. */
export function JointCard({ link, joint }: { link: RobotLink; joint: string }) {
  const host = useRef<HTMLDivElement>(null);
  const back = useRef<HTMLButtonElement>(null);
  useVersion(link);
  const text = useMore();
  const faults = (useFaults(link.faults) ?? []).filter((fault) => fault.source === joint);
  const events = link.twin.events.filter((event) => event.source === joint).slice(-EVENTS_SHOWN);
  useEffect(() => {
    if (host.current === null) return;
    const view = new JointCardView(host.current, link, joint);
    const write = () => view.write(link.nowMs());
    const stop = refreshWith(link.twin, write, [onTraces, onLanguage], SLIDES_EVERY_MS);
    // After a tap on the body, the focus stays there so that the camera's keys work.
    if (selection()?.from === 'numbers') back.current?.focus({ preventScroll: true });
    return () => {
      stop();
      view.dispose();
    };
  }, [link, joint]);
  usePageKeys(() => ({ close: () => close(joint) }));
  const { names } = useSettings();
  const code = isolated(joint);
  const words = wordsOfName(link.twin.schema, joint, languageTag());
  const plain = words === null ? undefined : isolated(words);
  const [name, other] = names === 'words' && plain !== undefined ? [plain, code] : [code, plain];
  const flags = link.twin.joints()?.rows.find(({ label }) => label === joint)?.flags ?? [];
  useNow(1000); // for the flags
  return (
    <section className="joint-card" data-testid="joint-card" aria-label={name}>
      <header>
        <IconButton label={text.closeCard} title={text.closeByEscape} ref={back} onClick={() => close(joint)}>
          <BackIcon />
        </IconButton>
        <h2 title={name}>{name}</h2>
        {other !== undefined && <span className="quiet">{other}</span>}
      </header>
      <div className="card-room">
        <OpenFaults link={link} faults={faults} />
        {flags.length > 0 && (
          <p className="card-flags">
            {flags.map((flag) => (
              <FlagTerm key={flag.name} source={joint} bit={flag.name} />
            ))}
          </p>
        )}
        <div ref={host} />
        <JointRoom link={link} joint={joint} />
        {events.length > 0 && (
          <ol className="card-events" aria-label={text.whatHappened}>
            {events.toReversed().map((event) => (
              <li key={event.n}>
                <time>{event.at === null ? '—' : formatClockSeconds(event.at * 1000)}</time>{' '}
                {flagWords(event.text)}
                {event.state === 'off' && <span className="quiet"> {text.cleared}</span>}
              </li>
            ))}
          </ol>
        )}
      </div>
    </section>
  );
}

/** Closes the card, and returns the focus to the joint's row once the table is shown again. */
function close(joint: string): void {
  selectJoint(null);
  requestAnimationFrame(() =>
    document.querySelector<HTMLElement>(`tr[data-label="${CSS.escape(joint)}"] button`)?.focus(),
  );
}
