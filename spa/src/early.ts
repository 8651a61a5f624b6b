/**
 * Runs before the page's own script has come: for a robot's page it starts what takes round trips. The stream connects,
 * the model's manifest and its coarsest level follow as soon as their names are known. The page finds all of it under way.
 */
import { manifestUrl, streamUrl, WANTED_HZ } from './app/addresses.ts';
import { ELSEWHERE, relaySettled, wasSignedIn } from './app/relay.ts';
import { parseRoute } from './app/route.ts';
import { takeToken } from './app/share_link.ts';
import { builtModelAt } from './model/files.ts';
import { startEarly } from './stream/start.ts';

performance.mark('posecast:early');
takeToken();
window.addEventListener('hashchange', takeToken);
const route = parseRoute(window.location.hash);
const settled = relaySettled();
if (route.page === 'robot' && document.documentElement.dataset.page !== 'embed') {
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
