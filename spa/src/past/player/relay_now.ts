import type { Playhead, Timeline } from '../past_types.ts';

/** Maximum age of the newest known moment while a robot is on air; if it is older, the relay's clock is unknown, ms. */
const RECENT_MS = 15_000;

/** The relay's clock minus the page's, ms, derived from the newest known moment; with `beforeMs`, the previous result. The newest
 *  moment is a lower bound for the relay's time. While nothing new is known, the clocks are assumed to agree. */
export function relayAhead(
  beforeMs: number,
  timeline: Pick<Timeline, 'toMs'>,
  playhead: Pick<Playhead, 'at' | 'momentMs'>,
  pageMs: number,
): number {
  const newestMs = playhead.at === 'live' ? Math.max(timeline.toMs, playhead.momentMs) : timeline.toMs;
  const aheadMs = Math.max(beforeMs, newestMs - pageMs);
  return aheadMs < -RECENT_MS ? Math.max(beforeMs, 0) : aheadMs;
}
