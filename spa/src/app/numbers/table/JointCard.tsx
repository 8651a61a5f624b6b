import './joint_card.css';
import { useEffect, useMemo, useRef, useState } from 'react';
import { manifestAt } from '../../../model/files.ts';
import { type Manifest, readManifest } from '../../../model/manifest.ts';
import {
  type Display,
  displayOf,
  flagWords,
  formatClockSeconds,
  formatNumber,
} from '../../../twin/format.ts';
import { JointChannels } from '../../../twin/kinematic_tree.ts';
import { limitMargin } from '../../../twin/limits.ts';
import { isolated, wordsOfName } from '../../../twin/names.ts';
import { Poser } from '../../../twin/playback/pose.ts';
import { FlagTerm } from '../../explain/terms.tsx';
import { BackIcon, IconButton } from '../../shell/icons.tsx';
import { usePageKeys } from '../../shell/page_keys.ts';
import { refreshWith } from '../../shell/refresh.ts';
import { useFaults } from '../../state/fault_keeper.ts';
import { useTicked } from '../../state/hooks.ts';
import { type RobotLink, useVersion } from '../../state/robot_link.ts';
import { useSettings } from '../../state/settings.ts';
import { onTraces, selection, selectJoint } from '../../state/viewing.ts';
import { languageTag, onLanguage, useMore } from '../../text/language.ts';
import { type BalanceText, useBalanceText } from '../../text/late.ts';
import { OpenFaults } from '../alarms/Alarms.tsx';
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
  const flags = useTicked(
    1000,
    () => link.twin.joints()?.rows.find(({ label }) => label === joint)?.flags ?? [],
  );
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

/** Numbers that change faster can't be read. */
const EVERY_MS = 250;
/** If less than this part of the joint's range is left, it is marked. */
const CAUTION_PART = 0.05;

/** The distance from a joint to its end stops, which come from the model: one line for each model joint that the channel moves.
 *  Empty for joints without limits. */
export function JointRoom({ link, joint }: { link: RobotLink; joint: string }) {
  const { angle } = useSettings();
  const text = useBalanceText();
  const room = useRooms(link, joint);
  const lines = useTicked(EVERY_MS, () => {
    const { state } = link.twin;
    if (room === null || state === null) return [];
    const values = room.poser.values(state.codes);
    return room.joints.flatMap(({ name, limits, slides }) => {
      const left = limitMargin(values[room.poser.joints.indexOf(name)] ?? null, limits);
      if (left === null) return [];
      const level = left.part / 2 < CAUTION_PART ? 'caution' : 'ok';
      return [{ name, level, words: roomWords(left, displayOf(slides ? 'm' : 'rad', angle), text) }];
    });
  });
  return lines.map(({ name, level, words }) => (
    <p className="card-room-left" key={name} data-testid="joint-room" data-level={level}>
      <button type="button" className="term" data-explain="balance.room" aria-haspopup="dialog">
        {text.room}
      </button>{' '}
      {lines.length > 1 || name !== joint ? `${isolated(name)}: ` : ''}
      {words}
    </p>
  ));
}

function roomWords(
  { left, nearer, part }: NonNullable<ReturnType<typeof limitMargin>>,
  display: Display,
  text: BalanceText,
): string {
  const value = `${formatNumber(Math.abs(left), display).trim()} ${display.unit}`;
  if (left < 0) return nearer === 'lower' ? text.beyondLower(value) : text.beyondUpper(value);
  const words = nearer === 'lower' ? text.toLower(value) : text.toUpper(value);
  return `${words}, ${text.ofItsWay(`${Math.round(part * 50)} %`)}`;
}

/** The model joints that the channel moves and that have limits; null before the model has loaded. */
function useRooms(link: RobotLink, joint: string) {
  useVersion(link);
  const { schema, modelHash } = link.twin;
  const { manifestUrl } = link;
  const [manifest, setManifest] = useState<Manifest | null>(null);
  useEffect(() => {
    setManifest(null);
    if (modelHash === null) return;
    let left = false;
    manifestAt(manifestUrl(modelHash))
      .then((raw) => !left && raw.v === 2 && setManifest(readManifest(raw)))
      .catch(() => {}); // the body reports the reason
    return () => {
      left = true;
    };
  }, [manifestUrl, modelHash]);
  return useMemo(() => {
    if (schema === null || manifest === null) return null;
    const moved = new JointChannels(schema).jointsOf(joint);
    const joints = manifest.joints.flatMap(({ name, type, limits }) =>
      limits !== null && type !== 'continuous' && moved.includes(name)
        ? [{ name, limits, slides: type === 'prismatic' }]
        : [],
    );
    return { poser: new Poser(schema, 'pos'), joints };
  }, [schema, manifest, joint]);
}
