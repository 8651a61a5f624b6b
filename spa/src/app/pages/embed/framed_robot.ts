import { parseRoute } from '../../state/route.ts';

/**
 * The robot of a frame. `/embed/hubo` names it in the path, so that its relay can say which pages may frame it; the fragment
 * can't then name another robot. `/embed/#/r/hubo` is for hosts that serve every robot the same page. Null if none or two are
 * named.
 */
export function framedRobot(pathname: string, hash: string): string | null {
  const named = /\/embed\/(?!index\.html$)(.+)$/.exec(pathname)?.[1];
  const route = parseRoute(hash);
  const asked = route.page === 'robot' ? route.robot : null;
  if (named === undefined) return asked;
  const spelled = parseRoute(`#/r/${named}`); // no percent-escapes, because a proxy may decode them differently
  if (spelled.page !== 'robot') return null;
  return asked === null || asked === named ? named : null;
}
