import { useEffect, useLayoutEffect, useState, useSyncExternalStore } from 'react';
import { recordingUrl, relayChoice } from '../relay/relay.ts';
import { isolated } from '../twin/names.ts';
import { closeLocal, listenForDrops, useLocal } from './pages/local/local.ts';
import { RobotPage } from './pages/RobotPage.tsx';
import { AbsentNotice, ErrorBoundary, late, onDemand } from './shell/late.tsx';
import { useThemeOnRoot } from './shell/theme.ts';
import { address, parseRoute, placeIn } from './state/address.ts';
import type { RobotLink } from './state/robot_link.ts';
import { useMore, useText } from './text/language.ts';

// Loaded on demand: a visitor who opens a robot needs no list.
const RobotList = late(async () => (await import('./pages/list/RobotList.tsx')).RobotList, onDemand);
// Few visitors need these pages, so they are loaded when opened.
const RecordingPage = late(
  async () => (await import('./pages/recording/RecordingPage.tsx')).RecordingPage,
  onDemand,
);
const RowPage = late(async () => (await import('./pages/RowPage.tsx')).RowPage, onDemand);
const SettingsSheet = late(async () => (await import('./settings/SettingsSheet.tsx')).SettingsSheet);
const LocalPage = late(async () => (await import('./pages/local/LocalPage.tsx')).LocalPage, onDemand);

export function App() {
  useThemeOnRoot();
  const [sheet, setSheet] = useState<{ link: RobotLink | null } | null>(null);
  const openSettings = (link?: RobotLink) => setSheet({ link: link ?? null });
  return (
    <ErrorBoundary>
      <Page onSettings={openSettings} />
      <AbsentNotice />
      <DropNotice />
      {sheet !== null && <SettingsSheet link={sheet.link} onClose={() => setSheet(null)} />}
    </ErrorBoundary>
  );
}

function Page({ onSettings }: { onSettings: (link?: RobotLink) => void }) {
  const hash = useSyncExternalStore(address.subscribe, () => placeIn(address.get()));
  const route = parseRoute(hash);
  const local = useLocal();
  const isRecording = local.phase === 'recording' || recordingUrl() !== null;
  const listed = route.page !== 'robot' && route.page !== 'robots' && local.phase !== 'shown' && !isRecording;
  useEffect(() => {
    if (listed) document.title = 'Posecast';
  }, [listed]);
  useLayoutEffect(listenForDrops, []); // before the first paint: a file dropped earlier would replace the page
  // biome-ignore lint/correctness/useExhaustiveDependencies: going anywhere leaves what was dropped
  useEffect(() => closeLocal, [hash]);
  if (local.phase === 'recording')
    return (
      <RecordingPage
        key={local.opened.id}
        given={local.opened}
        onClose={closeLocal}
        onSettings={onSettings}
      />
    );
  const { refused } = relayChoice();
  if (refused !== null) return <NothingHere hash={address.get()} refused={refused} />;
  if (local.phase === 'shown')
    return <LocalPage key={local.robot.path} robot={local.robot} urdfs={local.urdfs} />;
  if (isRecording) return <RecordingPage given={null} onClose={null} onSettings={onSettings} />;
  switch (route.page) {
    case 'list':
      return <RobotList onSettings={() => onSettings()} />;
    case 'robot':
      return <RobotPage key={route.robot} robot={route.robot} onSettings={onSettings} />;
    case 'robots':
      return <RowPage key={route.robots.join('+')} robots={route.robots} onSettings={onSettings} />;
    case 'unknown':
      return <NothingHere hash={route.hash} refused={null} />;
  }
}

/** Says that dropped files are being read, or why they show no robot. */
function DropNotice() {
  const text = useText();
  const local = useLocal();
  if (local.phase === 'reading') {
    return (
      <p className="drop-notice" role="status">
        {text.readingFiles}
      </p>
    );
  }
  if (local.phase !== 'refused') return null;
  return (
    <div className="drop-notice" role="alert" data-testid="drop-refused">
      <span>{local.why}</span>
      <button type="button" className="text-button" onClick={closeLocal}>
        {text.close}
      </button>
    </div>
  );
}

/** The page for an unknown address, or for an address with a relay that this page may not read. */
function NothingHere({ hash, refused }: { hash: string; refused: string | null }) {
  const text = useMore();
  if (refused !== null) {
    return (
      <main className="broken" data-testid="relay-refused">
        <h1>{text.notFromThere}</h1>
        <p>{text.relayRefused(isolated(refused))}</p>
        <a className="text-button" href={`${window.location.pathname}${hash}`}>
          {text.ownRelay}
        </a>
      </main>
    );
  }
  return (
    <main className="broken">
      <h1>{text.nothingHere}</h1>
      <p>{text.namesNothing(isolated(hash))}</p>
      <a className="text-button" href="#/">
        {text.backToAll}
      </a>
    </main>
  );
}
