import { useState } from 'react';
import { formatSpan } from '../twin/format.ts';
import { Sign } from './Chip.tsx';
import { CheckIcon, CopyIcon, RobotFigure, SettingsIcon } from './icons.tsx';
import { openChosen } from './local.ts';
import { type ListedRobot, useRobots } from './robots.ts';
import { robotHref } from './route.ts';

/** Who is on air: a grid of cards, or the lines that put a robot there. */
export function RobotList({ onSettings }: { onSettings: () => void }) {
  const listing = useRobots();
  const robots = listing.phase === 'waiting' ? [] : listing.robots;
  return (
    <div className="list-page">
      <header className="top">
        <a className="brand" href="#/">
          Posecast
        </a>
        <span className="grow" />
        <button type="button" className="icon-button" onClick={onSettings} aria-label="Settings">
          <SettingsIcon />
        </button>
      </header>
      <main className="list">
        <h1>On air</h1>
        {listing.phase === 'unreachable' && (
          <p className="list-note" role="status">
            No connection to the relay. Trying again.
          </p>
        )}
        {listing.phase === 'waiting' && <p className="quiet">Asking the relay who is on air.</p>}
        {robots.length > 0 && (
          <ul className="cards" data-testid="robots" data-old={listing.phase === 'unreachable'}>
            {robots.map((robot) => (
              <Card key={robot.robot} robot={robot} old={listing.phase === 'unreachable'} />
            ))}
          </ul>
        )}
        {listing.phase === 'known' && robots.length === 0 && <Empty />}
        <YourOwn />
      </main>
    </div>
  );
}

const WORDS = { online: 'LIVE', silent: 'STALE', offline: 'OFFLINE' } as const;

function Card({ robot, old }: { robot: ListedRobot; old: boolean }) {
  const word = old ? 'STALE' : WORDS[robot.state];
  const age = robot.ageMs !== null && word !== 'LIVE' && !old ? ` ${formatSpan(robot.ageMs)}` : '';
  const cause = old ? ': no connection' : word === 'STALE' ? ': robot silent' : '';
  return (
    <li>
      <a className="card" href={robotHref(robot.robot)} data-testid={`robot-${robot.robot}`}>
        <span className="thumb" data-state={word}>
          <RobotFigure />
        </span>
        <span className="card-name">{robot.name}</span>
        <span className="card-line">
          <span className="chip small" data-state={word}>
            <Sign word={word} />
            <b>{word}</b>
            <span className="chip-detail">
              {age}
              {cause}
            </span>
          </span>
          {robot.viewers !== null && (
            <span className="quiet">
              {robot.viewers} {robot.viewers === 1 ? 'viewer' : 'viewers'}
            </span>
          )}
        </span>
      </a>
    </li>
  );
}

/** The other way in: a robot from this computer, in this browser only. */
function YourOwn() {
  return (
    <section className="your-own" aria-label="Your own robot">
      <p className="quiet">
        Or drop a folder or a zip with a URDF anywhere on this page. It is shown here and sent nowhere.
      </p>
      <label className="text-button">
        Choose a folder
        <input
          type="file"
          className="unseen"
          data-testid="choose-folder"
          ref={(input) => input?.setAttribute('webkitdirectory', '')}
          onChange={({ target }) => openChosen(target.files)}
        />
      </label>
      <label className="text-button">
        Choose a zip
        <input
          type="file"
          accept=".zip"
          className="unseen"
          data-testid="choose-zip"
          onChange={({ target }) => openChosen(target.files)}
        />
      </label>
    </section>
  );
}

function Empty() {
  const relay = `tcp/${window.location.hostname || '127.0.0.1'}:7447`;
  return (
    <div className="empty" data-testid="no-robots">
      <p>No robot is on air. One line beside the robot puts it here.</p>
      <Command what="The demo robot" line={`posecast-edge run --robot demo --source demo --relay ${relay}`} />
      <Command
        what="Yours: one JSON object a line"
        line={`my-robot | posecast-edge run --robot mine --source jsonl --relay ${relay}`}
      />
    </div>
  );
}

function Command({ what, line }: { what: string; line: string }) {
  const [copied, setCopied] = useState(false);
  const copy = async () => {
    try {
      await navigator.clipboard.writeText(line);
      setCopied(true);
      setTimeout(() => setCopied(false), 2000);
    } catch {
      // Not allowed here (an insecure origin): the line can still be selected by hand.
    }
  };
  return (
    <figure className="command">
      <figcaption>{what}</figcaption>
      <pre>
        <code>{line}</code>
      </pre>
      <button type="button" className="icon-button" onClick={copy} aria-label={copied ? 'Copied' : 'Copy'}>
        {copied ? <CheckIcon /> : <CopyIcon />}
      </button>
    </figure>
  );
}
