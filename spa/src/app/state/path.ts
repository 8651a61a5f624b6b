/**
 * A relay serves the page also at `/r/demo`, and with status 404 at whatever somebody has mistyped. It says in the root
 * element how many folders above the page's files are (`data-home`). All else in the page knows hashes only.
 */

import { parseRoute } from './route.ts';

/** The hash of what a path below the page's folder names: of `r/demo`, `#/r/demo`. */
export function hashOfPath(path: string): string {
  return `#/${path.replace(/%2b/gi, '+')}`;
}

/** The hash that the page begins with where its path names `named`. Of two robots the path's counts, which is the one that
 *  the relay has told chats of; what the hash says besides is kept. Where only one of them names a robot, the hash counts,
 *  unless it is empty. */
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

/** Writes what the path names into the hash, unless the hash says more. Called before anything reads the hash. */
export function adoptPath(): void {
  const { dataset } = document.documentElement;
  if (dataset.home === undefined || dataset.page === 'embed') return;
  const home = new URL(dataset.home, window.location.href);
  dataset.home = home.href; // stays true when the path changes
  named = hashOfPath(window.location.pathname.slice(home.pathname.length));
  const hash = hashAtPath(named, window.location.hash);
  if (hash !== window.location.hash) window.history.replaceState(window.history.state, '', hash);
}

/** Goes to the page's own path as soon as the hash names something else than the path, so that a copy of the address
 *  says one thing. Called when the page's files are asked for already: their addresses are relative to the path. */
export function leavePath(): void {
  const { search, hash } = window.location;
  if (named === null || hash.split('?')[0] === named) return;
  window.history.replaceState(
    window.history.state,
    '',
    `${document.documentElement.dataset.home}${search}${hash}`,
  );
}
