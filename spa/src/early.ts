/**
 * Runs before the page's own script has come: for a robot's page it starts what takes round trips. The stream connects,
 * the model's manifest and its coarsest level follow as soon as their names are known. The page finds all of it under way.
 * Of a recording it asks for the index.
 */

import { adoptPath } from './app/state/path.ts';
import { parseRoute } from './app/state/route.ts';
import { laneUrl, manifestUrl } from './auth/lane.ts';
import { takeToken } from './auth/link_token.ts';
import { accessSettled } from './auth/settled.ts';
import { builtModelAt } from './model/files.ts';
import { streamUrl, WANTED_HZ } from './relay/addresses.ts';
import { early, recordingUrl } from './relay/recording_address.ts';
import { prepareStream, startEarly } from './stream/early_stream.ts';

performance.mark('posecast:early');
adoptPath();
takeToken();
window.addEventListener('hashchange', takeToken);
const route = parseRoute(window.location.hash);
const settled = accessSettled();
const recording = recordingUrl();
const embedded = document.documentElement.dataset.page === 'embed';
if (recording !== null) {
  if (!embedded) {
    const stop = new AbortController();
    const answer = fetch(recording, { credentials: 'omit', signal: stop.signal });
    answer.catch(() => {}); // it is asked for again, which says what is wrong
    early.request = { answer, stop };
  }
} else if (route.page === 'robot' && !embedded) {
  const { robot } = route;
  prepareStream(); // side by side with what is waited for
  // `config.json` may tell the stream to take no socket. It is as quick as the stream's own code; the page waits for it as well.
  settled.then(({ base }) => {
    if (base === null) return;
    startEarly(
      streamUrl(robot),
      WANTED_HZ,
      (hash) => void builtModelAt(manifestUrl(robot, hash)).catch(() => {}), // the page asks again, and says what is wrong
      laneUrl(robot),
    );
  });
}
