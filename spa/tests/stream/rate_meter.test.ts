import { expect, it } from 'vitest';
import { RateMeter } from '../../src/stream/pacing.ts';

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
