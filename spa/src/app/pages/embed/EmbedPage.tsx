import { useEffect, useState, useSyncExternalStore } from 'react';
import { recordingUrl, relayChoice } from '../../../relay/relay.ts';
import { isolated } from '../../../twin/names.ts';
import { missedMoment, PastBelowBody, useMomentNamed, usePast, useShown } from '../../past/PastBelowBody.tsx';
import { RobotFigure } from '../../shell/icons.tsx';
import { late, onDemand } from '../../shell/late.tsx';
import { useThemeOnRoot } from '../../shell/theme.ts';
import { address, parseRoute } from '../../state/address.ts';
import { type RobotLink, useRobotLink } from '../../state/robot_link.ts';
import { useMore } from '../../text/language.ts';
import { Framed } from './Framed.tsx';
import './embed.css';

const RecordingFrame = late(async () => (await import('./RecordingFrame.tsx')).RecordingFrame, onDemand);

/** One robot embedded in another site's page: body, state and origin. It sends no request before it is on screen. */
export function EmbedPage() {
  useThemeOnRoot();
  const rest = useMore();
  const robot = useSyncExternalStore(address.subscribe, () =>
    framedRobot(window.location.pathname, address.get()),
  );
  const reached = useReached();
  const { refused } = relayChoice();
  if (recordingUrl() !== null) return reached ? <RecordingFrame /> : <Poster />;
  if (refused !== null) return <Note text={rest.relayRefused(isolated(refused))} />;
  if (robot === null) return <Note text={rest.frameWithoutRobot} />;
  if (!reached) return <Poster />;
  return <Robot key={robot} robot={robot} />;
}

function Robot({ robot }: { robot: string }) {
  const link = useRobotLink(robot, false);
  return link === null ? <Poster /> : <Shown live={link} />;
}

function Shown({ live }: { live: RobotLink }) {
  const named = useMomentNamed();
  const past = usePast(live, named === 'moment');
  const missed = missedMoment(named, past);
  const link = useShown(live, past);
  const { search, hash } = window.location;
  return (
    <Framed
      link={link}
      live={live}
      whole={`${search}${hash || `#/r/${link.twin.robot}`}`}
      name={link.twin.name}
    >
      <PastBelowBody past={past} missed={missed} live={live} source={null} />
    </Framed>
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

/** True once any part of this frame has been on screen. */
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

/**
 * The robot of a frame. `/embed/hubo` names it in the path, so that its relay can say which pages may frame it; the fragment
 * can't then name another robot. `/embed/#/r/hubo` is for hosts that serve every robot the same page. Null if none or two are
 * named.
 */
export function framedRobot(pathname: string, hash: string): string | null {
  const named = /\/embed\/(?!index\.html$)(.+)$/.exec(pathname)?.[1];
  const route = parseRoute(hash);
  const asked = route.page === 'robot' ? route.robot : null;
  if (named === undefined) return asked;
  const spelled = parseRoute(`#/r/${named}`); // no percent-escapes, because a proxy may decode them differently
  if (spelled.page !== 'robot') return null;
  return asked === null || asked === named ? named : null;
}
