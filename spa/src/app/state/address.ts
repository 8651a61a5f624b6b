import { Emitter } from '../../kit.ts';

/**
 * The page's address. What the page shows is in its hash (`#/r/demo?joint=RKN`), so that one build works under any path of any host.
 * A relay also serves the page at `/r/demo`, and with status 404 at mistyped paths; the root element says how many folders up the
 * page's files are (`data-home`).
 */

const changed = new Emitter();

/** The hash of the page's address, with its `#`; empty if there is none. A store whose value is kept by the browser. */
export const address = { get: () => window.location.hash, subscribe: changed.on } as const;

if (typeof window !== 'undefined') window.addEventListener('hashchange', changed.emit);

/** Calls `listener` when the viewer follows another link, not after `writeHash`. Returns a function that stops it. */
export function onLink(listener: () => void): () => void {
  window.addEventListener('hashchange', listener);
  return () => window.removeEventListener('hashchange', listener);
}

/** Writes what the page shows into its address, without a step back to what it showed before. */
export function writeHash(hash: string, path = window.location.search): void {
  window.history.replaceState(window.history.state, '', path + hash);
  changed.emit();
}

/** Whether this page is a frame in another site's page, which must go on scrolling under a finger and the wheel. With
 *  `?gestures=all` the frame is as large as that page, and all gestures are its own. */
export function isGuest(): boolean {
  return (
    document.documentElement.dataset.page === 'embed' &&
    new URLSearchParams(window.location.search).get('gestures') !== 'all'
  );
}

/** The part of a hash that names a page; the query after it changes as the camera moves. */
export function placeIn(hash: string): string {
  return hash.split('?')[0] ?? '';
}

/** The query in a hash, the part after the first `?`; empty if there is none. */
export function queryOf(hash: string): URLSearchParams {
  return new URLSearchParams(hash.split('?')[1] ?? '');
}

/** The page that an address names. */
export type Route =
  | { page: 'list' }
  | { page: 'robot'; robot: string }
  /** Several robots side by side: `#/r/left+middle+right`. */
  | { page: 'robots'; robots: readonly string[] }
  | { page: 'unknown'; hash: string };

/** The most robots side by side; with more, each would be too small. */
export const MOST_SIDE_BY_SIDE = 6;

const ROBOT_ID = /^[a-z0-9][a-z0-9-]{0,62}$/;

/** The page that a hash names. Its query is ignored; an unknown page's `hash` is cut to 80 characters. */
export function parseRoute(hash: string): Route {
  const path = placeIn(hash).replace(/^#/, '');
  if (path === '' || path === '/') return { page: 'list' };
  const robots = [...new Set(/^\/r\/([^/]+)\/?$/.exec(path)?.[1]?.split('+'))];
  const [robot] = robots;
  if (robot !== undefined && robots.length <= MOST_SIDE_BY_SIDE && robots.every((id) => ROBOT_ID.test(id))) {
    return robots.length === 1 ? { page: 'robot', robot } : { page: 'robots', robots };
  }
  return { page: 'unknown', hash: path.slice(0, 80) };
}

/** The link to the page of one robot or, with several ids, of robots side by side. */
export function robotHref(...robots: readonly string[]): string {
  return `#/r/${robots.join('+')}`;
}

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
  if (hash !== window.location.hash) writeHash(hash, '');
}

/** Moves to the page's own path as soon as the hash names something other than the path, so that a copied address is unambiguous.
 *  Called once the page's files have been requested, because their addresses are relative to the path. */
export function leavePath(): void {
  const { search, hash } = window.location;
  if (named !== null && placeIn(hash) !== named)
    writeHash(hash, `${document.documentElement.dataset.home}${search}`);
}

/** How an address names a moment: "2026-11-22T14:02:07.250Z", rounded up, so that the frame shown at it is not after it. */
export function formatMoment(momentMs: number): string {
  return new Date(Math.ceil(momentMs)).toISOString();
}

/** The moment that an address names: `#/r/demo?t=2026-11-22T14:02:07.250Z`; null if it names none that can be read. */
export function momentIn(hash: string): number | null {
  const named = queryOf(hash).get('t');
  if (named === null || !/^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,3})?Z$/.test(named)) return null;
  const ms = Date.parse(named);
  return Number.isFinite(ms) ? ms : null;
}
