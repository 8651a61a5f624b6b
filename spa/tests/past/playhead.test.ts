import { expect, it } from 'vitest';
import { LOOK_MS_MAX, PlayheadClock } from '../../src/past/player/playhead_state.ts';

it('goes on at its speed while it runs, from where it was put', () => {
  const clock = new PlayheadClock();
  clock.set(5000, 100);
  expect(clock.target(600)).toBe(5000);
  clock.run(600);
  expect(clock.target(600)).toBe(5000);
  for (const [speed, targetMs] of [
    [1, 5200],
    [0.25, 5050],
    [4, 5800],
  ] as const) {
    clock.speed = speed;
    expect(clock.target(800)).toBe(targetMs);
  }
  clock.set(5800, 800);
  expect(clock.target(900)).toBe(6200);
  clock.running = false;
  expect(clock.target(900)).toBe(5800);
});

it('stands still while nobody looks, and where the clock does', () => {
  const clock = new PlayheadClock();
  clock.set(0, 1000);
  clock.run(1000);
  expect(clock.target(1000 + 3_600_000)).toBe(LOOK_MS_MAX);
  expect(clock.target(500)).toBe(0);
});
