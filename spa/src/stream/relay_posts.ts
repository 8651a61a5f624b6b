import { type Hello, type RateGranted, WIRE_VERSION } from '@posecast/wire';
import type { FromStream } from './messages.ts';

/** Reasons for a rate that the page need not explain. */
const AS_WISHED = new Set(['', 'asked', 'recovered']);
const SLOW_NETWORK = 'slow network';

/** The posts for a hello. `isSlowed`: the requested rate is lower than wanted, because the network is slow. */
export function helloPosts({ wire, hz, model, limits }: Hello, isSlowed: boolean): FromStream[] {
  const delayS = limits.get('delay_s') ?? 0;
  const posts: FromStream[] = [
    { kind: 'rate', hz, reason: isSlowed ? SLOW_NETWORK : null },
    { kind: 'model', hash: model },
    { kind: 'behind', ms: delayS > 0 ? 1000 * delayS : null },
  ];
  if (wire !== WIRE_VERSION) posts.push({ kind: 'problem', problem: { what: 'newer', detail: `${wire}` } });
  return posts;
}

export function ratePost({ hz, reason }: RateGranted): FromStream {
  return { kind: 'rate', hz, reason: AS_WISHED.has(reason) ? null : reason };
}
