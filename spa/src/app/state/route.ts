/** The page that an address names. It is in the hash, so that one build works under any path of any host. */
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
  const path = hash.replace(/^#/, '').split('?')[0] ?? '';
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
