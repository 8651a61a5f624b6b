import '../shell/styles/tools.css';
import './row.css';
import { type RefObject, useCallback, useEffect, useRef, useState } from 'react';
import { manifestUrl } from '../../relay/addresses.ts';
import type { RowMember, RowView } from '../../scene/figure/body_view.ts';
import type { RobotSigns } from '../../scene/signs/signs.ts';
import { BalanceLine } from '../balance/BalanceParts.tsx';
import { Notices } from '../robot/BodyNotes.tsx';
import { CameraViews, ShownChoice } from '../robot/BodyTools.tsx';
import { bindBody } from '../robot/body_link.ts';
import { Chip } from '../robot/Chip.tsx';
import { LoadLegend } from '../robot/LoadLegend.tsx';
import { SignMenu } from '../robot/SignMenu.tsx';
import { bindSigns } from '../robot/sign_link.ts';
import { keepLoading, useBodyView, useCameraControls } from '../robot/use_body_view.ts';

import { BackIcon, IconButton, SettingsIcon } from '../shell/icons.tsx';
import { robotHref } from '../state/address.ts';
import { type RobotLink, useRobotLink, useVersion, useWord } from '../state/robot_link.ts';
import { useMore, useText } from '../text/language.ts';
import { NumbersCard } from './NumbersCard.tsx';

/** A rectangle, CSS px from the picture's upper left corner. */
export interface LabelBox {
  readonly left: number;
  readonly top: number;
  readonly width: number;
  readonly height: number;
}

/** Space between a label and what is above it, CSS px. */
const AIR = 4;

/** Places labels near their `wished` positions: moved down just far enough that they overlap neither `taken` nor each other, and
 *  within a picture of this width. */
export function placeApart(
  wished: readonly LabelBox[],
  taken: readonly LabelBox[],
  width: number,
): LabelBox[] {
  const placed: LabelBox[] = [];
  for (const wish of wished) {
    const left = Math.max(0, Math.min(wish.left, width - wish.width));
    const inTheWay = [...taken, ...placed].filter(
      (other) => other.left < left + wish.width && left < other.left + other.width,
    );
    let top = Math.max(0, wish.top);
    // from top to bottom: moving a label down past one obstacle may bring it to the next
    for (const other of inTheWay.sort((a, b) => a.top - b.top)) {
      if (other.top < top + wish.height && top < other.top + other.height)
        top = other.top + other.height + AIR;
    }
    placed.push({ ...wish, left, top });
  }
  return placed;
}

/** Labels move to avoid these. */
const OVER_PICTURE = '.stage-views, .stage-legend';

/** Up to six robots side by side in one scene, each with its own state (LIVE, STALE, …) over its head. A robot without a body
 *  appears beside the scene as a card of numbers. */
export function RowPage({ robots, onSettings }: { robots: readonly string[]; onSettings: () => void }) {
  const host = useRef<HTMLDivElement>(null);
  const labels = useRef<(HTMLElement | null)[]>([]);
  const { view: scene, trouble, why, choose } = useLine(host, robots.length, labels);
  useCameraControls(host, scene);
  const [links, setLinks] = useState<readonly RobotLink[]>([]);
  const [signs, setSigns] = useState<readonly RobotSigns[]>([]);
  const onLink = useMembers(setLinks);
  const onSigns = useMembers(setSigns);
  const [bodiless, setBodiless] = useState<readonly Bodiless[]>([]);
  const onBodiless = useMembers(setBodiless);
  const text = useText();
  const rest = useMore();
  useEffect(() => {
    document.title = `${robots.join(', ')} · Posecast`;
  }, [robots]);
  return (
    <div className="robot-page" data-testid="line-page">
      <header className="top">
        <a className="icon-button" href="#/" aria-label={text.allRobots}>
          <BackIcon />
        </a>
        <h1 className="robot-name">{rest.robotsSideBySide(robots.length)}</h1>
        <span className="grow" />
        <IconButton label={text.settings} title={text.settings} onClick={onSettings}>
          <SettingsIcon />
        </IconButton>
      </header>
      <main className="split row-split" data-bodiless={bodiless.length === robots.length}>
        <div className="split-body">
          <section className="stage" aria-label={rest.bodies}>
            <div className="canvas" ref={host} data-testid="scene" data-shown="true" />
            {why !== null && (
              <div className="stage-middle">
                <p className="stage-say" data-testid="no-scene">
                  {why}
                </p>
              </div>
            )}
            <div className="stage-views">
              <Notices {...{ trouble, choose }} />
            </div>
            <div
              className={why === null ? 'line-labels' : 'line-labels listed'}
              data-many={robots.length > 3}
            >
              {robots.map((robot, i) => (
                <Member
                  key={robot}
                  robot={robot}
                  scene={scene}
                  body={scene?.robots[i] ?? null}
                  onLink={onLink}
                  onSigns={onSigns}
                  onBodiless={onBodiless}
                  label={(element) => {
                    labels.current[i] = element;
                  }}
                />
              ))}
            </div>
            {scene !== null && (
              <div className="stage-tools">
                <Shown links={links} />
                <CameraViews scene={scene} />
                <SignMenu links={links} drawsBalance={scene.drawsBalance} />
              </div>
            )}
            {scene !== null && <LoadLegend signs={signs} />}
          </section>
        </div>
        {bodiless.length > 0 && (
          <aside className="row-cards" aria-label={rest.withoutBody}>
            {robots.flatMap((robot) =>
              bodiless
                .filter(({ link }) => link.twin.robot === robot)
                .map(({ link, why }) => <NumbersCard key={robot} link={link} why={why} />),
            )}
          </aside>
        )}
      </main>
    </div>
  );
}

/** The choice of shown joint values, if any of the robots reports commands. */
function Shown({ links }: { links: readonly RobotLink[] }) {
  useVersion(...links);
  return links.some(({ twin }) => twin.schema?.field('ref') != null) && <ShownChoice />;
}

/** Collects what the robots of the row offer: each registers its item, and calls the returned function to remove it. */
function useMembers<T>(
  set: (change: (now: readonly T[]) => readonly T[]) => void,
): (member: T) => () => void {
  return useCallback(
    (member: T) => {
      set((now) => [...now, member]);
      return () => set((now) => now.filter((other) => other !== member));
    },
    [set],
  );
}

/** A robot that is not in the scene; `why` says why, null for one without a model. */
interface Bodiless {
  readonly link: RobotLink;
  readonly why: string | null;
}

interface MemberProps {
  readonly robot: string;
  readonly scene: RowView | null;
  readonly body: RowMember | null;
  readonly label: (element: HTMLElement | null) => void;
  readonly onLink: (link: RobotLink) => () => void;
  readonly onSigns: (signs: RobotSigns) => () => void;
  readonly onBodiless: (robot: Bodiless) => () => void;
}

/** One robot of the row: its connection, its body, and the label over its head. */
function Member(props: MemberProps) {
  const link = useRobotLink(props.robot, false);
  return link === null ? null : <Linked {...props} link={link} />;
}

function Linked(props: MemberProps & { link: RobotLink }) {
  const { robot, scene, body, label, link, onLink, onSigns, onBodiless } = props;
  useVersion(link);
  const known = useWord(link) !== null;
  const { modelHash } = link.twin;
  const [why, setWhy] = useState<string | null>(null);
  const [stands, setStands] = useState(false);
  const isBodiless = known && !stands && (modelHash === null || why !== null);

  useEffect(() => (isBodiless ? onBodiless({ link, why }) : undefined), [isBodiless, onBodiless, link, why]);

  useEffect(() => onLink(link), [onLink, link]);

  useEffect(() => {
    if (scene === null || body === null) return;
    return bindBody(
      {
        play: (source) => body.play(source),
        setGrey: (grey) => body.setGrey(grey),
        lockHeading: (locked) => body.lockHeading(locked),
        wake: () => scene.wake(),
      },
      link,
    );
  }, [scene, body, link]);

  useEffect(() => {
    if (scene === null || body === null) return;
    const { signs, stop } = bindSigns((read) => scene.showSigns(read, body), link);
    const leave = onSigns(signs);
    return () => {
      leave();
      stop();
    };
  }, [scene, body, link, onSigns]);

  useEffect(() => {
    if (body === null || modelHash === null) return;
    const url = manifestUrl(robot, modelHash);
    return keepLoading(
      url,
      () => body.load(url, () => {}),
      ({ error }) => {
        setWhy(error ?? null);
        if (error === undefined) setStands(true);
      },
    );
  }, [body, robot, modelHash]);

  if (isBodiless) return null;
  return (
    <div className="line-label" ref={label} data-testid={`line-${robot}`}>
      <a href={robotHref(robot)} className="line-name">
        {link.twin.name}
      </a>
      <Chip link={link} />
      <BalanceLine link={link} brief />
    </div>
  );
}

/** A view with several robots, whose labels follow their heads. */
function useLine(
  host: RefObject<HTMLDivElement | null>,
  count: number,
  labels: RefObject<(HTMLElement | null)[]>,
) {
  const shown = useRef<RowView | null>(null);
  const prepare = useCallback(
    async () => (view: RowView) => {
      while (view.robots.length < count) view.addRobot();
      shown.current = view;
      return () => {
        shown.current = null;
      };
    },
    [count],
  );
  const follow = useCallback(() => {
    const view = shown.current;
    const stage = host.current?.parentElement;
    if (view === null || stage == null) return;
    const heads = view.robots.flatMap((robot, i) => {
      const label = labels.current[i];
      const top = view.topOf(robot);
      if (label == null) return [];
      label.style.visibility = top === null ? 'hidden' : 'visible';
      if (top === null) return [];
      const { offsetWidth: width, offsetHeight: height } = label;
      return [{ label, left: top.x - width / 2, top: top.y - height, width, height }];
    });
    const taken = [...stage.querySelectorAll<HTMLElement>(OVER_PICTURE)].map((each) => ({
      ...{ left: each.offsetLeft, top: each.offsetTop },
      ...{ width: each.offsetWidth, height: each.offsetHeight },
    }));
    for (const [i, { left, top }] of placeApart(heads, taken, stage.clientWidth).entries())
      heads[i]!.label.style.transform = `translate(${left}px, ${top}px)`;
  }, [host, labels]);
  const body = useBodyView(host, prepare);
  const { drawn } = body;
  useEffect(() => drawn.on(follow), [drawn, follow]);
  return body;
}
