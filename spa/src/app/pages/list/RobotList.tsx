import './list.css';
import { useEffect, useState } from 'react';
import { savesData } from '../../../browser/late_part.ts';
import { fetchBytes, fetchManifest, fileUrl } from '../../../model/bundle.ts';
import { thumbnailOf } from '../../../model/manifest.ts';
import { manifestUrl } from '../../../relay/addresses.ts';
import { accounts, home, relayChoice } from '../../../relay/relay.ts';
import { signInNeeded } from '../../../relay/request.ts';
import { tokenFor } from '../../../relay/token.ts';
import { prepareStream } from '../../../stream/early_stream.ts';
import { formatSpan } from '../../../twin/format.ts';
import type { Verdict } from '../../../twin/liveness.ts';
import { Sign } from '../../robot/Chip.tsx';
import { Command } from '../../shell/Command.tsx';
import { IconButton, RobotFigure, SettingsIcon } from '../../shell/icons.tsx';
import { late } from '../../shell/late.tsx';
import { MOST_SIDE_BY_SIDE, robotHref } from '../../state/address.ts';
import { useStore } from '../../state/hooks.ts';
import { useMore, useText } from '../../text/language.ts';
import { causeWords } from '../../words/status.ts';
import { openChosen } from '../local/local.ts';
import { inOrder, judgeListed, type ListedRobot, useRobots } from './robots.ts';

const PICTURE_BYTES = 500_000;

/** The picture in a robot's model bundle, which the relay may still have after the robot has left; otherwise a generic
 *  drawing. */
function Thumbnail({ robot: { robot, model } }: { robot: ListedRobot }) {
  const [src, setSrc] = useState<string | null>(null);
  useEffect(() => {
    if (model === null) return;
    const leave = new AbortController();
    const url = manifestUrl(robot, model);
    let made = '';
    const picture = async () => {
      const path = thumbnailOf(await fetchManifest(url, leave.signal));
      const file = path === null ? null : fileUrl(url, { path });
      if (file === null || tokenFor(file) === undefined) return file;
      // an <img> can't send a token
      const bytes = await fetchBytes(file, PICTURE_BYTES, leave.signal, () => {});
      made = URL.createObjectURL(new Blob([new Uint8Array(bytes)]));
      return made;
    };
    picture()
      .then((found) => !leave.signal.aborted && setSrc(found))
      .catch(() => {}); // the list works without pictures
    return () => {
      leave.abort();
      URL.revokeObjectURL(made);
    };
  }, [robot, model]);
  if (src === null) return <RobotFigure />;
  return (
    <img
      className="thumb-picture"
      src={src}
      crossOrigin="anonymous" // no cookies for another relay or a lane
      alt=""
      onError={() => setSrc(null)}
      data-testid="thumbnail"
    />
  );
}

/** After this long the viewer is assumed to have read the list. */
const AHEAD_AFTER_MS = 1500;

const SignIn = late(async () => (await import('../../settings/SignIn.tsx')).SignIn);

/** Preloads the code that shows a robot's numbers, shortly after the list is shown. Returns a function that stops it. */
function prepareRobotPage(): () => void {
  const timer = setTimeout(() => {
    if (savesData()) return;
    prepareStream();
    import('../../numbers/Panel.tsx').catch(() => {}); // requested again when needed
  }, AHEAD_AFTER_MS);
  return () => clearTimeout(timer);
}

/** The page with the robots on air or, if there are none, commands that put one on air; below, the robots that were on air. */
export function RobotList({ onSettings }: { onSettings: () => void }) {
  const text = useText();
  const rest = useMore();
  useEffect(prepareRobotPage, []);
  const listing = useRobots();
  const needsSignIn = useStore(signInNeeded);
  const robots = listing.phase === 'waiting' ? [] : listing.robots;
  const host = new URL(relayChoice().base ?? home()).host;
  const elsewhere = host === window.location.host ? null : host;
  /** The robots to show side by side, in the order chosen; null while cards are plain links. */
  const [chosen, setChosen] = useState<readonly string[] | null>(null);
  const old = listing.phase === 'unreachable';
  const tookMs = listing.phase === 'known' ? listing.tookMs : 0;
  const [here, gone] = inOrder(robots);
  const hasNamesake = ({ name }: ListedRobot) => robots.filter((other) => other.name === name).length > 1;
  const cards = (shown: readonly ListedRobot[], testId: string) => (
    <ul className="cards" data-testid={testId} data-old={old}>
      {shown.map((robot) => (
        <Card
          key={robot.robot}
          robot={robot}
          hasNamesake={hasNamesake(robot)}
          verdict={old ? NOT_HEARD : judgeListed(robot, tookMs)}
          place={chosen === null ? null : chosen.indexOf(robot.robot)}
          onChoose={() => setChosen((before) => toggled(before ?? [], robot.robot))}
        />
      ))}
    </ul>
  );
  return (
    <div className="list-page">
      <header className="top">
        <a className="brand" href="#/">
          Posecast
        </a>
        {elsewhere !== null && (
          <span className="quiet" data-testid="relay-host">
            {elsewhere}
          </span>
        )}
        <span className="grow" />
        {accounts !== null && <SignIn />}
        <IconButton onClick={onSettings} label={text.settings}>
          <SettingsIcon />
        </IconButton>
      </header>
      <main className="list">
        <h1>{rest.onAir}</h1>
        {listing.phase === 'unreachable' && (
          <p className="list-note" role="status">
            {needsSignIn ? text.endedSignIn : rest.noRelay}
          </p>
        )}
        {listing.phase === 'waiting' && <p className="quiet">{rest.askingRelay}</p>}
        {here.length > 0 && cards(here, 'robots')}
        {listing.phase === 'known' && here.length === 0 && <Empty publishAt={listing.publishAt} />}
        {robots.length > 1 && <SideBySide chosen={chosen} onChosen={setChosen} />}
        {gone.length > 0 && (
          <section className="was-on-air" aria-labelledby="was-on-air">
            <h2 id="was-on-air">{rest.wasOnAir}</h2>
            {cards(gone, 'gone-robots')}
          </section>
        )}
        <YourOwn />
      </main>
    </div>
  );
}

const NOT_HEARD = { word: 'STALE', cause: 'no connection', ageMs: null } as const;

/** Adds a robot to the choice or removes it. If the choice is full, it stays as it is. */
function toggled(chosen: readonly string[], robot: string): readonly string[] {
  if (chosen.includes(robot)) return chosen.filter((other) => other !== robot);
  return chosen.length < MOST_SIDE_BY_SIDE ? [...chosen, robot] : chosen;
}

/** The buttons for showing two to six robots in one scene. */
function SideBySide(props: {
  chosen: readonly string[] | null;
  onChosen: (chosen: readonly string[] | null) => void;
}) {
  const { chosen, onChosen } = props;
  const rest = useMore();
  if (chosen === null) {
    return (
      <button type="button" className="text-button side-by-side" onClick={() => onChosen([])}>
        {rest.sideBySide}
      </button>
    );
  }
  return (
    <div className="side-by-side" data-testid="side-by-side">
      {chosen.length < 2 ? (
        <span className="quiet">{rest.chooseSome}</span>
      ) : (
        <a className="text-button" href={robotHref(...chosen)}>
          {rest.showSideBySide(chosen.length)}
        </a>
      )}
      <button type="button" className="text-button" onClick={() => onChosen(null)}>
        {rest.cancel}
      </button>
    </div>
  );
}

/** A link to one robot. `hasNamesake`: another robot of the list has its name, so its id is shown. `place`: its index in the side-by-side choice, -1 if not chosen, null outside choosing mode. */
function Card(props: {
  robot: ListedRobot;
  hasNamesake: boolean;
  verdict: Pick<Verdict, 'word' | 'cause' | 'ageMs'>;
  place: number | null;
  onChoose: () => void;
}) {
  const { robot, place, onChoose } = props;
  const { word, cause: why, ageMs } = props.verdict;
  const age = robot.ageMs !== null && word !== 'LIVE' && ageMs !== null ? ` ${formatSpan(ageMs)}` : '';
  const rest = useMore();
  const cause = causeWords(why);
  return (
    <li>
      <a
        className="card"
        href={robotHref(robot.robot)}
        data-testid={`robot-${robot.robot}`}
        data-chosen={place !== null && place >= 0}
        onClick={(event) => {
          if (place === null) return;
          event.preventDefault();
          onChoose();
        }}
      >
        {place !== null && <span className="card-place">{place < 0 ? '' : place + 1}</span>}
        <span className="thumb" data-state={word}>
          <Thumbnail robot={robot} />
        </span>
        <span className="card-name" title={robot.name}>
          {robot.name}
        </span>
        {props.hasNamesake && <span className="card-id quiet">{robot.robot}</span>}
        <span className="card-line">
          <span className="chip small" data-state={word}>
            <Sign word={word} />
            <b>{word}</b>
            <span className="chip-detail">
              {age !== '' && cause !== '' ? `${age}: ${cause}` : age || cause}
            </span>
          </span>
          {robot.viewers !== null && robot.viewers > 0 && (
            <span className="quiet">{rest.viewers(robot.viewers)}</span>
          )}
        </span>
      </a>
    </li>
  );
}

/** Buttons for opening robot files from this computer. They are shown in this browser only. */
function YourOwn() {
  const rest = useMore();
  return (
    <section className="your-own" aria-label={rest.yourOwn}>
      <p className="quiet">{rest.dropHere}</p>
      <label className="text-button">
        {rest.chooseFolder}
        <input
          type="file"
          className="unseen"
          data-testid="choose-folder"
          ref={(input) => input?.setAttribute('webkitdirectory', '')}
          onChange={({ target }) => openChosen(target.files)}
        />
      </label>
      <label className="text-button">
        {rest.chooseZip}
        <input
          type="file"
          accept=".zip,.posecast"
          className="unseen"
          data-testid="choose-zip"
          onChange={({ target }) => openChosen(target.files)}
        />
      </label>
    </section>
  );
}

/** Commands that put a robot on air. `publishAt`: the endpoint that needs no credential; null if every publisher needs one. */
function Empty({ publishAt }: { publishAt: string | null }) {
  const rest = useMore();
  const relay = publishAt ?? `tls/${window.location.hostname}:PORT --credential FILE`;
  return (
    <div className="empty" data-testid="no-robots">
      <p>{rest.nobodyOnAir}</p>
      <Command what={rest.demoRobot} line={`posecast run --robot demo --source demo --relay ${relay}`} />
      <Command
        what={rest.yours}
        line={`my-robot | posecast run --robot mine --source jsonl --relay ${relay}`}
      />
      <p className="quiet">
        {publishAt === null ? rest.askOperator : rest.onThatComputer} {rest.agentAlone}
      </p>
    </div>
  );
}
