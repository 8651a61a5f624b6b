import { afterEach, beforeEach, expect, it, vi } from 'vitest';

beforeEach(() => {
  vi.resetModules();
  vi.useFakeTimers();
});
afterEach(() => {
  vi.restoreAllMocks();
  vi.useRealTimers();
});

/** The wall clock continues while `performance.now()` stops, as on a sleeping device. */
function sleep(ms: number): void {
  const standsAtMs = performance.now();
  vi.advanceTimersByTime(ms);
  const awakeMs = performance.now();
  const real = performance.now.bind(performance);
  vi.spyOn(performance, 'now').mockImplementation(() => standsAtMs + real() - awakeMs);
}

it('counts the time that the device slept, once the page looks', async () => {
  const { countSleep, nowMs } = await import('../../src/stream/clock.ts');
  const beforeMs = nowMs();
  sleep(60_000);
  expect(nowMs() - beforeMs).toBeLessThan(1);
  expect(countSleep()).toBeCloseTo(60_000, 0);
  expect(nowMs() - beforeMs).toBeCloseTo(60_000, 0);
  vi.advanceTimersByTime(1000);
  expect(countSleep()).toBeCloseTo(60_000, 0);
  expect(nowMs() - beforeMs).toBeCloseTo(61_000, 0);
});

it('takes a wall clock that drifts, or is set back, for no sleep', async () => {
  const { countSleep, nowMs } = await import('../../src/stream/clock.ts');
  const beforeMs = nowMs();
  vi.setSystemTime(Date.now() - 3_600_000);
  expect(countSleep()).toBe(0);
  for (let n = 0; n < 60; n++) {
    vi.setSystemTime(Date.now() + 100);
    expect(countSleep()).toBe(0);
  }
  expect(nowMs() - beforeMs).toBeLessThan(1);
});

it('a worker has what the page counted', async () => {
  const { countSleep, nowMs, setSlept } = await import('../../src/stream/clock.ts');
  const beforeMs = nowMs();
  setSlept(5000);
  expect(nowMs() - beforeMs).toBeCloseTo(5000, 0);
  expect(countSleep()).toBe(5000);
});
