import { parseRoute } from '../../state/route.ts';

/**
 * The robot of a frame: `/embed/hubo` names it, so that its relay can say which pages may frame it, and then the
 * fragment can't name another. `/embed/#/r/hubo` is for hosts that answer every robot alike. Null: none, or two.
 */
export function framedRobot(pathname: string, hash: string): string | null {
  const named = /\/embed\/(?!index\.html$)(.+)$/.exec(pathname)?.[1];
  const route = parseRoute(hash);
  const asked = route.page === 'robot' ? route.robot : null;
  if (named === undefined) return asked;
  const spelled = parseRoute(`#/r/${named}`); // not by %-signs, which a host in between may read otherwise
  if (spelled.page !== 'robot') return null;
  return asked === null || asked === named ? named : null;
}
