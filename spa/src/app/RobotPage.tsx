import { useEffect, useLayoutEffect, useRef, useState } from 'react';
import { Announcer } from './Announcer.tsx';
import { Body } from './Body.tsx';
import { Chip } from './Chip.tsx';
import { Divider } from './Divider.tsx';
import { showLink } from './handle.ts';
import { BackIcon, FullscreenIcon, PanelIcon, SettingsIcon } from './icons.tsx';
import { SIDE_BY_SIDE, useMedia } from './media.ts';
import { Panel } from './Panel.tsx';
import { type RobotLink, useRobotLink, useVersion, useWord } from './robot_link.ts';
import { Sheet } from './Sheet.tsx';
import { changeSettings, useSettings } from './settings.ts';
import { heightPx, type SheetHeight } from './sheet_heights.ts';

const PANEL_LEAST_PX = 320;
const BODY_LEAST_PX = 280;

export function RobotPage({ robot, onSettings }: { robot: string; onSettings: () => void }) {
  const link = useRobotLink(robot);
  useEffect(() => {
    showLink(link);
    return () => showLink(null);
  }, [link]);
  useEffect(() => {
    document.title = `${robot} · Posecast`;
  }, [robot]);
  return link === null ? null : <Loaded link={link} onSettings={onSettings} />;
}

function Loaded({ link, onSettings }: { link: RobotLink; onSettings: () => void }) {
  const word = useWord(link);
  const { panelOpen } = useSettings();
  const page = useRef<HTMLDivElement>(null);
  useVersion(link);
  const name = link.twin.schema?.robot ?? link.twin.robot;

  const fullscreen = () => {
    if (document.fullscreenElement !== null) void document.exitFullscreen();
    else void page.current?.requestFullscreen?.().catch(() => undefined); // an iPhone has none
  };
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => {
      const typing = event.target instanceof HTMLInputElement && event.target.type !== 'radio';
      if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === 't' || event.key === 'T') changeSettings({ panelOpen: !panelOpen });
      else if (event.key === 'f' || event.key === 'F') fullscreen();
    };
    window.addEventListener('keydown', onKey);
    return () => window.removeEventListener('keydown', onKey);
  });

  return (
    <div className="robot-page" ref={page} data-word={word ?? ''} data-testid="robot-page">
      <header className="top">
        <a className="icon-button" href="#/" aria-label="All robots">
          <BackIcon />
        </a>
        <h1 className="robot-name" title={link.twin.robot}>
          {name}
        </h1>
        <Chip link={link} />
        <span className="grow" />
        <button
          type="button"
          className="icon-button wide-only"
          aria-label="Show the numbers"
          aria-pressed={panelOpen}
          title="Numbers (T)"
          onClick={() => changeSettings({ panelOpen: !panelOpen })}
        >
          <PanelIcon />
        </button>
        {document.fullscreenEnabled && (
          <button
            type="button"
            className="icon-button wide-only"
            aria-label="Fullscreen"
            title="Fullscreen (F)"
            onClick={fullscreen}
          >
            <FullscreenIcon />
          </button>
        )}
        <button
          type="button"
          className="icon-button"
          aria-label="Settings"
          title="Settings"
          onClick={onSettings}
        >
          <SettingsIcon />
        </button>
      </header>
      <Split link={link} />
      <Announcer link={link} />
    </div>
  );
}

/** Body first, numbers beside it; on a phone held upright the numbers are a sheet over the body. */
function Split({ link }: { link: RobotLink }) {
  const sideBySide = useMedia(SIDE_BY_SIDE);
  const { panelOpen, panelPx } = useSettings();
  const room = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState<{ width: number; height: number } | null>(null);
  const [draggedPx, setDraggedPx] = useState<number | null>(null);
  const [height, setHeight] = useState<SheetHeight>('half');

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
  // The body keeps the room above a sheet at rest; a full sheet lies over it.
  const coveredPx = heightPx(height === 'full' ? 'half' : height, size.height);
  return (
    <main className={sideBySide ? 'split' : 'split stacked'} ref={room}>
      <div className="split-body" style={sideBySide ? undefined : { bottom: `${coveredPx - 12}px` }}>
        <Body link={link} />
      </div>
      {sideBySide && panelOpen && (
        <>
          <Divider
            widthPx={widthPx}
            onWidth={(px, done) => {
              const fitting = panelWidth(px, size.width);
              setDraggedPx(done ? null : fitting);
              if (done) changeSettings({ panelPx: fitting });
            }}
          />
          <aside className="split-panel" style={{ width: `${widthPx}px` }} aria-label="Numbers">
            <Panel link={link} />
          </aside>
        </>
      )}
      {!sideBySide && (
        <Sheet height={height} roomPx={size.height} onHeight={setHeight}>
          <Panel link={link} />
        </Sheet>
      )}
    </main>
  );
}

/** What was chosen, as far as it fits; unchosen, wide enough for every column where there is room. */
function panelWidth(chosenPx: number | null, roomPx: number): number {
  const wanted = chosenPx ?? (roomPx >= 1200 ? 500 : roomPx >= 1000 ? 440 : 340);
  return Math.max(PANEL_LEAST_PX, Math.min(wanted, roomPx - BODY_LEAST_PX));
}
