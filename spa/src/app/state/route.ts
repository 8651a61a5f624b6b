/** The pages. They live in the hash, so that one build works under any path of any host. */
export type Route =
  | { page: 'list' }
  | { page: 'robot'; robot: string }
  /** Side by side: `#/r/left+middle+right`. */
  | { page: 'robots'; robots: readonly string[] }
  | { page: 'unknown'; hash: string };

/** More would each be too small to be looked at. */
export const MOST_SIDE_BY_SIDE = 6;

const ROBOT_ID = /^[a-z0-9][a-z0-9-]{0,62}$/;

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

export function robotHref(...robots: readonly string[]): string {
  return `#/r/${robots.join('+')}`;
}
