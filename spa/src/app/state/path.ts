/**
 * A relay also serves the page at `/r/demo`, and with status 404 at mistyped paths. The root element says how many folders up the
 * page's files are (`data-home`). The rest of the page uses only hashes.
 */

import { parseRoute } from './route.ts';

/** The hash for a path below the page's folder: for `r/demo`, `#/r/demo`. */
export function hashOfPath(path: string): string {
  return `#/${path.replace(/%2b/gi, '+')}`;
}

/** The initial hash if the path names `named`. If both name a robot, the path wins, because the relay has published it in link
 *  previews; the rest of the hash is kept. If only one names a robot, the hash wins unless it is empty. */
export function hashAtPath(named: string, hash: string): string {
  if (hash.length < 2) return named;
  const [ofPath, ofHash] = [robotsOf(named), robotsOf(hash)];
  if (ofPath === '' || ofHash === '' || ofPath === ofHash) return hash;
  const query = hash.indexOf('?');
  return query < 0 ? named : named + hash.slice(query);
}

function robotsOf(hash: string): string {
  const route = parseRoute(hash);
  if (route.page === 'robots') return route.robots.join('+');
  return route.page === 'robot' ? route.robot : '';
}

let named: string | null = null;

/** Writes the path's robot into the hash, unless the hash has priority. Called before anything reads the hash. */
export function adoptPath(): void {
  const { dataset } = document.documentElement;
  if (dataset.home === undefined || dataset.page === 'embed') return;
  const home = new URL(dataset.home, window.location.href);
  dataset.home = home.href; // stays true when the path changes
  named = hashOfPath(window.location.pathname.slice(home.pathname.length));
  const hash = hashAtPath(named, window.location.hash);
  if (hash !== window.location.hash) window.history.replaceState(window.history.state, '', hash);
}

/** Moves to the page's own path as soon as the hash names something other than the path, so that a copied address is unambiguous.
 *  Called once the page's files have been requested, because their addresses are relative to the path. */
export function leavePath(): void {
  const { search, hash } = window.location;
  if (named === null || hash.split('?')[0] === named) return;
  window.history.replaceState(
    window.history.state,
    '',
    `${document.documentElement.dataset.home}${search}${hash}`,
  );
}
