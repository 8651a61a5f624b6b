/**
 * Runs before the page's main script has loaded. On a robot's page it starts everything that takes round trips: the stream
 * connects, and the model's manifest and coarsest level are requested as soon as their names are known. The page then picks up
 * these requests. For a recording, it requests the index.
 */

import { adoptPath, parseRoute } from './app/state/address.ts';
import { builtModelAt } from './model/files.ts';
import { accessSettled, laneUrl, manifestUrl, streamUrl, WANTED_HZ } from './relay/addresses.ts';
import { early, recordingUrl } from './relay/relay.ts';
import { request } from './relay/request.ts';
import { takeToken } from './relay/visitor.ts';
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
    const answer = request(recording, { signal: stop.signal });
    answer.catch(() => {}); // the page requests it again and reports the error
    early.request = { answer, stop };
  }
} else if (route.page === 'robot' && !embedded) {
  const { robot } = route;
  prepareStream(); // in parallel with what the page waits for
  // `config.json` may tell the stream not to open a socket. It loads as fast as the stream's own code, and the page waits for it
  // as well.
  settled.then(({ base }) => {
    if (base === null) return;
    startEarly(
      streamUrl(robot),
      WANTED_HZ,
      (hash) => void builtModelAt(manifestUrl(robot, hash)).catch(() => {}), // the page requests it again and reports the error
      laneUrl(robot),
    );
  });
}
