import { type ReactNode, useEffect } from 'react';
import { home, relayChoice } from '../../../relay/relay.ts';
import { Announcer } from '../../robot/Announcer.tsx';
import { Body } from '../../robot/Body.tsx';
import { Chip } from '../../robot/Chip.tsx';
import { shownLink } from '../../shell/debug_api.ts';
import { late } from '../../shell/late.tsx';
import { type RobotLink, useVersion } from '../../state/robot_link.ts';
import { followPresentLinks, usePresenting } from '../../state/viewing.ts';
import { useMore } from '../../text/language.ts';
import { connectParent } from './parent.ts';

const Presentation = late(async () => (await import('../../present/Presentation.tsx')).Presentation);

/** One robot, present or past, in a frame: body, state and origin. */
export function Framed({
  link,
  live,
  whole,
  name,
  note,
  children,
}: {
  link: RobotLink;
  live: RobotLink;
  /** Query and hash of the full page. */
  whole: string;
  name: string;
  /** Shown beside the body while presenting. */
  note?: ReactNode;
  /** Shown below the body. */
  children: ReactNode;
}) {
  useEffect(() => {
    shownLink.set(link);
    return () => shownLink.set(null);
  }, [link]);
  useVersion(link);
  const rest = useMore();
  const presented = usePresenting();
  useEffect(followPresentLinks, []);
  useEffect(() => connectParent(link), [link]);
  const { base } = relayChoice();
  const from = new URL(base ?? home()).host;
  return (
    <main className="embed" data-present={presented} data-testid="embed">
      <div className="embed-body">
        <Body link={link} live={live} />
      </div>
      {children}
      <footer className="embed-foot">
        <Chip link={link} />
        <h1 className="embed-name" title={name}>
          {name}
        </h1>
        <span className="grow" />
        <a href={`${home()}${whole}`} target="_blank" rel="noreferrer" title={rest.from(from)}>
          <span className="embed-from">Posecast </span>
          <span aria-hidden="true">↗</span>
        </a>
      </footer>
      {presented && <Presentation link={link} name={name} note={note} />}
      <Announcer link={link} />
    </main>
  );
}
