import { expect, it } from 'vitest';
import { Lateness, lowerHz } from '../src/stream/pacing/lateness.ts';

it('is how much later than the quickest of its connection something came, by two clocks that share nothing', () => {
  const lateness = new Lateness();
  lateness.begin(1_000_000);
  lateness.stamped(1_000_090, 50); // the first took longer
  lateness.stamped(1_000_100, 100);
  expect(lateness.ms).toBe(0);
  lateness.stamped(1_000_400, 150);
  expect(lateness.ms).toBe(250);
  lateness.begin(1_000_500);
  expect(lateness.ms).toBe(0);
});

it('counts only when it lasts, and not while a connection settles', () => {
  const lateness = new Lateness();
  lateness.begin(0);
  lateness.stamped(10, 0);
  const told: number[] = [];
  for (let nowMs = 250; nowMs <= 12_000; nowMs += 250) {
    lateness.stamped(nowMs, nowMs - 2600);
    if (lateness.tooLate(nowMs)) told.push(nowMs);
  }
  expect(told[0]).toBe(9000);
});

it('lowers a rate step by step', () => {
  expect([60, 30, 10, 5, 2, 1, 0.5].map(lowerHz)).toEqual([10, 10, 5, 2, 1, 1, 0.5]);
});
