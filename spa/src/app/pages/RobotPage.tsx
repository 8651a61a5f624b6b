import {
  type ReactNode,
  type RefObject,
  useCallback,
  useEffect,
  useLayoutEffect,
  useRef,
  useState,
} from 'react';
import { isThen } from '../../twin/liveness.ts';
import type { Tab } from '../numbers/Panel.tsx';
import { missedMoment, PastBelowBody, useMomentNamed, usePast, useShown } from '../past/PastBelowBody.tsx';
import { Body } from '../robot/Body.tsx';
import { Chip } from '../robot/Chip.tsx';
import { Divider } from '../shell/Divider.tsx';
import { shownLink } from '../shell/debug_api.ts';
import { BackIcon, FullscreenIcon, IconButton, PanelIcon, SettingsIcon, ShareIcon } from '../shell/icons.tsx';
import { late, lateAfterBody } from '../shell/late.tsx';
import { usePageKeys, withKey } from '../shell/page_keys.ts';
import { heightPx, Sheet, type SheetHeight } from '../shell/Sheet.tsx';
import { SIDE_BY_SIDE, useMedia } from '../shell/theme.ts';
import {
  type RobotLink,
  useBehindMs,
  useIsOld,
  useRobotLink,
  useVersion,
  useWord,
} from '../state/robot_link.ts';
import { changeSettings, useSettings } from '../state/settings.ts';
import { followPresentLinks, onSelection, present, selection, usePresenting } from '../state/viewing.ts';
import { say, useText } from '../text/language.ts';
import { behindWords } from '../words/status.ts';

const Panel = late(async () => (await import('../numbers/Panel.tsx')).Panel);
const Announcer = lateAfterBody(async () => (await import('../robot/Announcer.tsx')).Announcer);
const Explanations = lateAfterBody(async () => (await import('../explain/Explanations.tsx')).Explanations);
const ShareSheet = late(async () => (await import('../share/ShareSheet.tsx')).ShareSheet);
const Presentation = late(async () => (await import('../present/Presentation.tsx')).Presentation);
const KeysSheet = late(async () => (await import('../settings/KeysSheet.tsx')).KeysSheet);

const PANEL_LEAST_PX = 320;
const BODY_LEAST_PX = 280;
/** In a lower window, the numbers would hide the body. */
const LOW_PX = 400;
/** The second tap of a double tap still hits the body. */
const RAISE_MS = 400;

export function RobotPage({ robot, onSettings }: { robot: string; onSettings: (link: RobotLink) => void }) {
  const link = useRobotLink(robot, true);
  return link === null ? null : <Loaded live={link} onSettings={() => onSettings(link)} />;
}

function Loaded({ live, onSettings }: { live: RobotLink; onSettings: () => void }) {
  const past = usePast(live);
  const missed = missedMoment(useMomentNamed(), past);
  const link = useShown(live, past);
  const text = useText();
  useVersion(link);
  const { name, robot } = link.twin;
  const presented = usePresenting();
  return (
    <OneRobot
      link={link}
      live={live}
      title={robot}
      name={name}
      head={
        <>
          <a className="icon-button" href="#/" aria-label={text.allRobots}>
            <BackIcon />
          </a>
          <h1 className="robot-name" title={name === robot ? name : `${name} (${robot})`}>
            {name}
          </h1>
        </>
      }
      share={(close) => <ShareSheet robot={robot} name={name} onClose={close} />}
      onSettings={onSettings}
    >
      {past === undefined && !presented && <div className="past-room" />}
      <PastBelowBody past={past} missed={missed} live={live} source={past?.source ?? null} />
    </OneRobot>
  );
}

/** One robot, present or past: the top bar, the body and the numbers, and the time line below. */
export function OneRobot(props: {
  link: RobotLink;
  /** The source for the page's address; null: the address stays as it is. */
  live: RobotLink | null;
  /** For the window title; follows the word for a recording. */
  title: string;
  /** The name of what is presented, safe to show (`isolated`). */
  name: string;
  /** The note about this moment, shown while presenting. */
  note?: ReactNode;
  /** The link back, and the name. */
  head: ReactNode;
  /** null: this view can't be shared. */
  share: ((close: () => void) => ReactNode) | null;
  onSettings: () => void;
  /** The element below the body. */
  children: ReactNode;
}) {
  const { link, live, title, share, onSettings } = props;
  useEffect(() => {
    shownLink.set(link);
    return () => shownLink.set(null);
  }, [link]);
  const text = useText();
  const word = useWord(link);
  const behindMs = useBehindMs(link);
  const behind = behindWords(behindMs, word);
  useEffect(() => {
    document.title = [isThen(word) || behind ? word : '', behind, title, 'Posecast']
      .filter((part) => part !== '')
      .join(' · ');
  }, [title, word, behind]);
  const { panelOpen } = useSettings();
  const page = useRef<HTMLDivElement>(null);
  useVersion(link);
  const presented = usePresenting();
  useEffect(followPresentLinks, []);
  useEffect(() => {
    import('../numbers/Panel.tsx').catch(() => {}); // at once, rather than after the sheet around it; `Panel` tries again
  }, []);

  const { fullscreen, toggle } = useFullscreen(page);
  const [sheet, setSheet] = useState<'share' | 'keys' | null>(null);
  const toggleNumbers = () => changeSettings({ panelOpen: !panelOpen });
  usePageKeys(() => ({
    numbers: toggleNumbers,
    fullscreen: toggle,
    present: () => present(!presented),
    list: () => setSheet('keys'),
    ...(share !== null && { share: () => setSheet('share') }),
  }));

  return (
    <div
      className="robot-page"
      ref={page}
      data-word={word ?? ''}
      data-old={useIsOld(link)}
      data-fullscreen={fullscreen}
      data-present={presented}
      data-testid="robot-page"
    >
      <header className="top">
        {props.head}
        <Chip link={link} />
        <span className="grow" />
        <IconButton
          className="icon-button wide-only"
          label={text.showNumbers}
          aria-pressed={panelOpen}
          title={withKey(text.numbers, 'numbers')}
          onClick={toggleNumbers}
        >
          <PanelIcon />
        </IconButton>
        <IconButton
          className="icon-button fullscreen-button"
          label={text.fullscreen}
          aria-pressed={fullscreen !== 'off'}
          title={withKey(text.fullscreen, 'fullscreen')}
          onClick={toggle}
        >
          <FullscreenIcon />
        </IconButton>
        {share !== null && (
          <IconButton
            label={text.share}
            title={withKey(text.share, 'share')}
            onClick={() => setSheet('share')}
          >
            <ShareIcon />
          </IconButton>
        )}
        <IconButton label={text.settings} title={text.settings} onClick={onSettings}>
          <SettingsIcon />
        </IconButton>
      </header>
      <Split link={link} live={live} alone={presented || fullscreen === 'page'} />
      {props.children}
      <Announcer link={link} />
      <Explanations link={link} />
      {presented && <Presentation link={link} name={props.name} note={props.note} />}
      {sheet === 'share' && share?.(() => setSheet(null))}
      {sheet === 'keys' && <KeysSheet onClose={() => setSheet(null)} />}
    </div>
  );
}

/** Body first, numbers beside it; on a phone in portrait the numbers are a sheet over the body. `alone`: no numbers. */
function Split({ link, live, alone }: { link: RobotLink; live: RobotLink | null; alone: boolean }) {
  const sideBySide = useMedia(SIDE_BY_SIDE);
  const { panelOpen, panelPx } = useSettings();
  const room = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState<{ width: number; height: number } | null>(null);
  const [draggedPx, setDraggedPx] = useState<number | null>(null);
  const [height, setHeight] = useState<SheetHeight>(() => (window.innerHeight < LOW_PX ? 'peek' : 'half'));
  const [tab, setTab] = useState<Tab>('Joints');

  useEffect(() => {
    let raise: ReturnType<typeof setTimeout> | undefined;
    const leave = onSelection(() => {
      clearTimeout(raise);
      if (selection() === null) return;
      raise = setTimeout(() => setHeight((now) => (now === 'peek' ? 'half' : now)), RAISE_MS);
    });
    return () => {
      leave();
      clearTimeout(raise);
    };
  }, []);

  useLayoutEffect(() => {
    const element = room.current;
    if (element === null) return;
    const measure = () => setSize({ width: element.clientWidth, height: element.clientHeight });
    measure();
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    return () => observer.disconnect();
  }, []);

  if (size === null) return <main className="split" ref={room} />;
  const widthPx = panelWidth(draggedPx ?? panelPx, size.width);
  // The body uses the room above a partly open sheet; a full sheet covers it.
  const coveredPx = heightPx(height === 'full' ? 'half' : height, size.height);
  return (
    <main className={sideBySide ? 'split' : 'split stacked'} ref={room}>
      <div className="split-body" style={sideBySide || alone ? undefined : { bottom: `${coveredPx - 12}px` }}>
        <Body link={link} live={live} />
      </div>
      {sideBySide && panelOpen && !alone && (
        <>
          <Divider
            widthPx={widthPx}
            onWidth={(px, done) => {
              const fitting = panelWidth(px, size.width);
              setDraggedPx(done ? null : fitting);
              if (done) changeSettings({ panelPx: fitting });
            }}
          />
          <aside className="split-panel" style={{ width: `${widthPx}px` }} aria-label={say().numbers}>
            <Panel link={link} tab={tab} onTab={setTab} />
          </aside>
        </>
      )}
      {!sideBySide && !alone && (
        <Sheet height={height} roomPx={size.height} onHeight={setHeight}>
          <Panel link={link} tab={tab} onTab={setTab} />
        </Sheet>
      )}
    </main>
  );
}

/** The chosen width, limited to what fits; by default wide enough for every column if there is room. */
function panelWidth(chosenPx: number | null, roomPx: number): number {
  const wanted = chosenPx ?? (roomPx >= 1200 ? 500 : roomPx >= 1000 ? 440 : 340);
  return Math.max(PANEL_LEAST_PX, Math.min(wanted, roomPx - BODY_LEAST_PX));
}

/** Whether the body is shown alone. `screen`: the browser's fullscreen mode; `page`: the body fills the page, because the
 *  browser has no fullscreen here (an iPhone, an iframe without that permission). */
type Fullscreen = 'off' | 'screen' | 'page';

/** The fullscreen state of the element `page`, and a function that switches it on or off. Escape switches it off, too. */
function useFullscreen(page: RefObject<HTMLElement | null>): {
  fullscreen: Fullscreen;
  toggle: () => void;
} {
  const [fullscreen, setFullscreen] = useState<Fullscreen>('off');

  useEffect(() => {
    const changed = () => setFullscreen(document.fullscreenElement === null ? 'off' : 'screen');
    document.addEventListener('fullscreenchange', changed);
    return () => document.removeEventListener('fullscreenchange', changed);
  }, []);

  // in the browser's own fullscreen mode the browser handles Escape
  usePageKeys(fullscreen === 'page' ? () => ({ close: () => setFullscreen('off') }) : null);

  const toggle = useCallback(() => {
    if (fullscreen === 'page') setFullscreen('off');
    else if (document.fullscreenElement) void document.exitFullscreen();
    else if (document.fullscreenEnabled && page.current?.requestFullscreen) {
      page.current.requestFullscreen().catch(() => setFullscreen('page'));
    } else setFullscreen('page');
  }, [fullscreen, page]);

  return { fullscreen, toggle };
}
