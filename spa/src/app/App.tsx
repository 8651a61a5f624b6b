import { useEffect, useState } from 'react';
import { ErrorBoundary } from './ErrorBoundary.tsx';
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
      {settingsOpen && <SettingsSheet onClose={() => setSettingsOpen(false)} />}
    </ErrorBoundary>
  );
}

function Page({ onSettings }: { onSettings: () => void }) {
  const route = parseRoute(useHash());
  const listed = route.page !== 'robot';
  useEffect(() => {
    if (listed) document.title = 'Posecast';
  }, [listed]);
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
