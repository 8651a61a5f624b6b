import { expect, it } from 'vitest';
import { RateMeter } from '../src/stream/pacing/rate_meter.ts';

it('is measured between the first and the last arrival of two seconds', () => {
  const pace = new RateMeter();
  expect(pace.hz(0)).toBe(0);
  pace.recordArrival(0);
  expect(pace.hz(0), 'one is no pace').toBe(0);
  for (let i = 1; i <= 100; i++) pace.recordArrival(i * 50);
  expect(pace.hz(5000)).toBeCloseTo(20);
  expect(pace.hz(9000), 'long ago').toBe(0);
});
