import { expect, it } from 'vitest';
import { RateMeter, retryDelayMs } from '../../src/stream/pacing.ts';

it('full jitter under a ceiling that doubles from half a second to thirty seconds', () => {
  const ceilings = [0, 1, 2, 3, 4, 5, 6, 7, 20].map((failures) => retryDelayMs('backoff', failures, 1, null));
  expect(ceilings).toEqual([500, 1000, 2000, 4000, 8000, 16_000, 30_000, 30_000, 30_000]);
  expect(retryDelayMs('backoff', 7, 0, null)).toBe(0);
  expect(retryDelayMs('backoff', 2, 0.25, null)).toBe(500);
});

it('spreads a hall that is sent away over the time the relay names, ten seconds when it names none', () => {
  expect(retryDelayMs('spread', 0, 0.5, 4)).toBe(2000);
  expect(retryDelayMs('spread', 0, 0.5, null)).toBe(5000);
  expect(retryDelayMs('spread', 1, 0.5, 4)).toBe(500);
});

it('waits as long as the relay asks, thirty seconds when it does not say, and then some', () => {
  expect(retryDelayMs('wait', 0, 0, 12)).toBe(12_000);
  expect(retryDelayMs('wait', 0, 0, null)).toBe(30_000);
  expect(retryDelayMs('wait', 2, 0.5, 12)).toBe(13_000);
});

it('asks for an absent robot after half a minute to a minute, however often', () => {
  expect([0, 0.5, 1].map((random) => retryDelayMs('later', 0, random, null))).toEqual([
    30_000, 45_000, 60_000,
  ]);
  expect(retryDelayMs('later', 9, 0, null)).toBe(30_000);
});

it('does not come back by itself where that would not help', () => {
  expect(retryDelayMs('never', 0, 0.5, 3)).toBeNull();
});

it('is measured between the first and the last arrival of two seconds', () => {
  const pace = new RateMeter();
  expect(pace.hz(0)).toBe(0);
  pace.recordArrival(0);
  expect(pace.hz(0), 'one is no pace').toBe(0);
  for (let i = 1; i <= 100; i++) pace.recordArrival(i * 50);
  expect(pace.hz(5000)).toBeCloseTo(20);
  expect(pace.hz(9000), 'long ago').toBe(0);
});

it.each([500, 1000, 1500, 2500, 3500])(
  'of frames that arrive in bursts, one each %i ms, is theirs',
  (everyMs) => {
    const pace = new RateMeter();
    for (let burst = 1; burst <= 10; burst++) {
      const perBurst = (everyMs * 30) / 1000;
      for (let n = 0; n < perBurst; n++) pace.recordArrival(burst * everyMs + (20 * n) / perBurst);
      const nowMs = burst * everyMs + 20;
      if (burst > 8) expect(pace.hz(nowMs)).toBeCloseTo(30, -1);
    }
  },
);

it('of a single burst says nothing', () => {
  const pace = new RateMeter();
  for (let n = 0; n < 60; n++) pace.recordArrival(1000 + n / 3);
  expect(pace.hz(1020)).toBe(0);
});

it.each([
  ['after half a minute', 30_000, 900, 400],
  ['after an outage of half a minute', 30_000, 900, 400],
  ['at once', 100, 30, 1000],
])('of frames that come %s is no more than their times prove', (when, firstMs, count, withinMs) => {
  const pace = new RateMeter(0);
  if (when.includes('outage')) pace.recordArrival(10);
  for (let n = 0; n < count; n++) pace.recordArrival(firstMs + (n * withinMs) / count);
  const hz = pace.hz(firstMs + withinMs);
  expect(Math.round(hz / 3)).toBe(10);
  pace.restart(50_000); // such as when the page is seen again
  expect(pace.hz(50_100)).toBe(0);
});
