import { useEffect, useState } from 'react';
import { ErrorBoundary } from './ErrorBoundary.tsx';
import { LocalPage } from './LocalPage.tsx';
import { closeLocal, listenForDrops, useLocal } from './local.ts';
import { RobotList } from './RobotList.tsx';
import { RobotPage } from './RobotPage.tsx';
import { parseRoute, useHash } from './route.ts';
import { SettingsSheet } from './SettingsSheet.tsx';
import { useThemeOnRoot } from './theme.ts';

export function App() {
  useThemeOnRoot();
  const [settingsOpen, setSettingsOpen] = useState(false);
  const openSettings = () => setSettingsOpen(true);
  return (
    <ErrorBoundary>
      <Page onSettings={openSettings} />
      <DropNotice />
      {settingsOpen && <SettingsSheet onClose={() => setSettingsOpen(false)} />}
    </ErrorBoundary>
  );
}

function Page({ onSettings }: { onSettings: () => void }) {
  const hash = useHash();
  const route = parseRoute(hash);
  const local = useLocal();
  const listed = route.page !== 'robot' && local.phase !== 'shown';
  useEffect(() => {
    if (listed) document.title = 'Posecast';
  }, [listed]);
  useEffect(listenForDrops, []);
  // biome-ignore lint/correctness/useExhaustiveDependencies: going anywhere leaves what was dropped
  useEffect(() => closeLocal, [hash]);
  if (local.phase === 'shown') return <LocalPage key={local.robot.name} robot={local.robot} />;
  switch (route.page) {
    case 'list':
      return <RobotList onSettings={onSettings} />;
    case 'robot':
      return <RobotPage key={route.robot} robot={route.robot} onSettings={onSettings} />;
    case 'unknown':
      return (
        <main className="broken">
          <h1>Nothing here</h1>
          <p>This link names nothing that the page knows: {route.hash}</p>
          <a className="text-button" href="#/">
            All robots
          </a>
        </main>
      );
  }
}

/** What became of a drop that shows no robot. */
function DropNotice() {
  const local = useLocal();
  if (local.phase === 'reading') {
    return (
      <p className="drop-notice" role="status">
        Reading the files.
      </p>
    );
  }
  if (local.phase !== 'refused') return null;
  return (
    <div className="drop-notice" role="alert" data-testid="drop-refused">
      <span>{local.why}</span>
      <button type="button" className="text-button" onClick={closeLocal}>
        Close
      </button>
    </div>
  );
}
