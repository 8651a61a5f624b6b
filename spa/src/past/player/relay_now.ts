import type { Playhead, Timeline } from '../past_types.ts';

/** What is known is at most so old while a robot is on air; if it is older, nothing is known about the relay's clock, ms. */
const RECENT_MS = 15_000;

/** How far the relay's clock is ahead of the page's, ms, by the newest moment that is known; with `beforeMs`, what was found
 *  before: the newest was never more than new. While nothing new is known, the clocks are taken to agree. */
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
