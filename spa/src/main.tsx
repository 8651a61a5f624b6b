import './early.ts';
import { StrictMode } from 'react';
import { createRoot } from 'react-dom/client';
import { App } from './app/App.tsx';
import { hasWebGl, loadThree } from './app/robot/use_body_view.ts';
import { installDebugApi } from './app/shell/debug_api.ts';
import { AbsentNotice, ErrorBoundary, late, onDemand, reloadAfterDeploy } from './app/shell/late.tsx';
import { address, leavePath, onLink, parseRoute, queryOf } from './app/state/address.ts';
import { applyLinkSettings } from './app/state/settings.ts';
import { bindLanguage } from './app/text/language.ts';
import { accessSettled } from './relay/addresses.ts';
import { recordingUrl } from './relay/relay.ts';
import './app/shell/styles/tokens.css';
import './app/shell/styles/page.css';
import './app/shell/styles/robot.css';

/** `embed/index.html` is the same page for an iframe. It sends no request before it is on screen. */
const EmbedPage = late(async () => (await import('./app/pages/embed/EmbedPage.tsx')).EmbedPage, onDemand);
const embedded = document.documentElement.dataset.page === 'embed';

performance.mark('posecast:script');
// Before the first render: these are the largest parts of the page, and every robot page needs them.
const { page } = parseRoute(address.get());
const isRecording = recordingUrl() !== null;
if (!embedded && isRecording) {
  import('./app/pages/recording/RecordingPage.tsx').catch(() => {}); // the body is shown after its first pose
  import('./app/numbers/Panel.tsx').catch(() => {});
} else if (!embedded && page === 'robot') {
  import('./app/numbers/Panel.tsx').catch(() => {}); // the page requests it again and reports the error
  if (hasWebGl()) loadThree().catch(() => {});
} else if (!embedded && page === 'list') import('./app/pages/list/RobotList.tsx').catch(() => {});
installDebugApi();
const lend = () => applyLinkSettings(queryOf(address.get()));
lend();
leavePath();
onLink(leavePath);
onLink(lend);
reloadAfterDeploy();
const root = document.getElementById('root');
if (root !== null) {
  Promise.all([accessSettled(), bindLanguage()]).then(() =>
    createRoot(root).render(
      <StrictMode>
        {embedded ? (
          <ErrorBoundary>
            <EmbedPage />
            <AbsentNotice />
          </ErrorBoundary>
        ) : (
          <App />
        )}
      </StrictMode>,
    ),
  );
}
