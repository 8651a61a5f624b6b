import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { LivenessWatch } from '../src/app/watch.ts';
import { nowMs } from '../src/stream/clock.ts';
import { STALE_AFTER_MS } from '../src/twin/liveness.ts';
import { RobotTwin } from '../src/twin/robot.ts';

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

it('says STALE in the very moment in which the pose gets too old', () => {
  const twin = new RobotTwin('demo', nowMs());
  const watch = new LivenessWatch(twin);
  twin.acceptConnection(true, nowMs());
  twin.acceptWatching(true, nowMs());
  vi.advanceTimersByTime(137); // not a round number of looks
  const shownMs = nowMs();
  twin.acceptStatus({ robot: 'online', ageMs: 20, seq: 7, degraded: false, atMs: shownMs });
  Object.assign(twin.evidence, { freshMs: shownMs, shownMs });
  const said: [string | null, number][] = [];
  watch.onWord(() => said.push([watch.word, nowMs() - shownMs]));
  for (const atMs of [600, 1200]) {
    vi.advanceTimersByTime(shownMs + atMs - nowMs());
    const ageMs = nowMs() - shownMs;
    twin.acceptStatus({ robot: 'online', ageMs, seq: 7, degraded: false, atMs: nowMs() });
  }
  vi.advanceTimersByTime(shownMs + 2 * STALE_AFTER_MS - nowMs());
  watch.close();
  expect(said.map(([word]) => word)).toEqual(['LIVE', 'STALE']);
  expect(Math.round(said[1]?.[1] ?? Number.NaN)).toBe(STALE_AFTER_MS);
});
