import { Suspense, useEffect, useState } from 'react';
import { home, relayChoice } from '../../../relay/relay.ts';
import { Body } from '../../body/Body.tsx';
import { missedMoment, useMomentNamed, usePast, useShown } from '../../past/use_past.ts';
import { showLink } from '../../shell/debug_api.ts';
import { RobotFigure } from '../../shell/icons.tsx';
import { late, onDemand } from '../../shell/late.tsx';
import { useThemeOnRoot } from '../../shell/theme.ts';
import { useHash } from '../../state/hash.ts';
import { followPresentLinks, usePresenting } from '../../state/presenting.ts';
import { type RobotLink, useRobotLink, useVersion } from '../../state/robot_link.ts';
import { Announcer } from '../../status/Announcer.tsx';
import { Chip } from '../../status/Chip.tsx';
import { useMore } from '../../text/more.ts';
import { framedRobot } from './framed_robot.ts';
import { connectParent } from './parent.ts';
import './embed.css';
import { isolated } from '../../../twin/names.ts';

const NoPast = late(async () => (await import('../../past/NoPast.tsx')).NoPast, onDemand);
const PastBar = late(async () => (await import('../../past/index.ts')).PastBar, onDemand);
const Presentation = late(async () => (await import('../../present/Presentation.tsx')).Presentation);

/** One robot embedded in another site's page: body, state and origin. Nothing is requested until it is on the screen.
 *  */
export function EmbedPage() {
  useThemeOnRoot();
  const rest = useMore();
  const hash = useHash();
  const robot = framedRobot(window.location.pathname, hash);
  const reached = useReached();
  const { refused } = relayChoice();
  if (refused !== null) return <Note text={rest.relayRefused(isolated(refused))} />;
  if (robot === null) return <Note text={rest.frameWithoutRobot} />;
  if (!reached) return <Poster />;
  return <Robot key={robot} robot={robot} />;
}

function Robot({ robot }: { robot: string }) {
  const link = useRobotLink(robot);
  return link === null ? <Poster /> : <Shown live={link} />;
}

function Shown({ live }: { live: RobotLink }) {
  const named = useMomentNamed();
  const past = usePast(live, named === 'moment');
  const missed = missedMoment(named, past);
  const link = useShown(live, past);
  useEffect(() => {
    showLink(link);
    return () => showLink(null);
  }, [link]);
  useVersion(link);
  const rest = useMore();
  const presented = usePresenting();
  useEffect(followPresentLinks, []);
  useEffect(() => connectParent(link), [link]);
  const { name } = link.twin;
  const { base } = relayChoice();
  const from = new URL(base ?? home()).host;
  const { search, hash } = window.location;
  const whole = `${home()}${search}${hash || `#/r/${link.twin.robot}`}`;
  return (
    <main className="embed" data-present={presented} data-testid="embed">
      <div className="embed-body">
        <Body link={link} live={live} />
      </div>
      {missed !== null && !presented && (
        <Suspense fallback={null}>
          <NoPast why={missed} />
        </Suspense>
      )}
      {past && !presented && (
        <Suspense fallback={null}>
          <PastBar controls={past.controls} live={live} source={null} />
        </Suspense>
      )}
      <footer className="embed-foot">
        <Chip link={link} />
        <h1 className="embed-name">{name}</h1>
        <span className="grow" />
        <a href={whole} target="_blank" rel="noreferrer" title={rest.from(from)}>
          Posecast <span aria-hidden="true">↗</span>
        </a>
      </footer>
      {presented && (
        <Suspense fallback={null}>
          <Presentation link={link} />
        </Suspense>
      )}
      <Announcer link={link} />
    </main>
  );
}

function Poster() {
  return (
    <div className="embed embed-poster" data-testid="embed-poster">
      <RobotFigure />
    </div>
  );
}

function Note({ text }: { text: string }) {
  return (
    <p className="embed embed-note" role="alert">
      {text}
    </p>
  );
}

/** True from the first moment in which a part of this frame is on the screen. */
function useReached(): boolean {
  const [reached, setReached] = useState(typeof IntersectionObserver === 'undefined');
  useEffect(() => {
    if (reached) return;
    const observer = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) setReached(true);
    });
    observer.observe(document.documentElement);
    return () => observer.disconnect();
  }, [reached]);
  return reached;
}
