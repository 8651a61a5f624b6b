import { useSyncExternalStore } from 'react';

/** The pages. They live in the hash, so that one build works under any path of any host. */
export type Route = { page: 'list' } | { page: 'robot'; robot: string } | { page: 'unknown'; hash: string };

const ROBOT_ID = /^[a-z0-9][a-z0-9-]{0,62}$/;

export function parseRoute(hash: string): Route {
  const path = hash.replace(/^#/, '').split('?')[0] ?? '';
  if (path === '' || path === '/') return { page: 'list' };
  const robot = /^\/r\/([^/]+)\/?$/.exec(path)?.[1];
  if (robot !== undefined && ROBOT_ID.test(robot)) return { page: 'robot', robot };
  return { page: 'unknown', hash: path.slice(0, 80) };
}

export function robotHref(robot: string): string {
  return `#/r/${robot}`;
}

function subscribe(listener: () => void): () => void {
  window.addEventListener('hashchange', listener);
  return () => window.removeEventListener('hashchange', listener);
}

export function useHash(): string {
  return useSyncExternalStore(subscribe, () => window.location.hash);
}
