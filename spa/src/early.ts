/**
 * Runs before the page's own script has come: for a robot's page it starts what takes round trips. The stream connects,
 * the model's manifest and its coarsest level follow as soon as their names are known. The page finds all of it under way.
 * Of a recording it asks for the index.
 */

import { adoptPath } from './app/state/path.ts';
import { parseRoute } from './app/state/route.ts';
import { manifestUrl } from './auth/lane.ts';
import { takeToken } from './auth/link_token.ts';
import { accessSettled } from './auth/settled.ts';
import { builtModelAt } from './model/files.ts';
import { streamUrl, WANTED_HZ } from './relay/addresses.ts';
import { early, recordingUrl } from './relay/recording_address.ts';
import { ELSEWHERE, wasSignedIn } from './relay/relay.ts';
import { startEarly } from './stream/early_stream.ts';

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
  const start = () =>
    startEarly(streamUrl(robot), WANTED_HZ, (hash) => {
      builtModelAt(manifestUrl(robot, hash)).catch(() => {}); // the page asks again, and says what is wrong
    });
  const first = streamUrl(robot);
  // Most pages are served by their relay: they need not wait for a file that says so, nor for anybody's token.
  const elsewhere = ELSEWHERE.test(window.location.search) || wasSignedIn();
  if (!elsewhere) start();
  settled.then(({ base }) => {
    if (base !== null && (elsewhere || streamUrl(robot) !== first)) start();
  });
}
