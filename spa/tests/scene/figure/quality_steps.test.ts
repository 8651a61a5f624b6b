import { describe, expect, it } from 'vitest';
import {
  CALM_MS,
  FIRST_CALM_MS,
  HOPELESS_MS,
  HOPELESS_WINDOWS,
  QualitySteps,
  SLOW_MS,
  STEPS,
  WINDOW,
} from '../../../src/scene/figure/quality_steps.ts';

const DOWN = STEPS.at(-1)!;

/** Repaints of this length for this many seconds; returns how often the step changed. */
function run(pace: QualitySteps, intervalMs: number, seconds: number): number {
  let changes = 0;
  for (let ms = 0; ms < seconds * 1000; ms += intervalMs) changes += pace.recordRepaint(intervalMs) ? 1 : 0;
  return changes;
}

describe('the pace of a device', () => {
  it('a fast one keeps everything', () => {
    const pace = new QualitySteps();
    expect(run(pace, 1000 / 60, 120)).toBe(0);
    expect(pace.step).toEqual(STEPS[0]);
  });

  it('a slow one gives up pixels first, then detail, step by step, and no more than there is', () => {
    const pace = new QualitySteps();
    const steps = [];
    for (let i = 0; i < 10 * WINDOW; i += 1) if (pace.recordRepaint(SLOW_MS + 1)) steps.push(pace.step);
    expect(steps).toEqual(STEPS.slice(1));
    expect(steps[0]!.pixels).toBeLessThan(1);
    expect(steps.findIndex(({ lowest }) => lowest)).toBeGreaterThan(0);
  });

  it('is hopeless when nothing is left to give up and there are still fewer than ten pictures a second', () => {
    const pace = new QualitySteps();
    for (let i = 0; i < 10 * WINDOW; i += 1) pace.recordRepaint(HOPELESS_MS - 10);
    expect(pace.step).toEqual(DOWN);
    expect(pace.hopeless, 'ten a second suffice').toBe(false);
    const needed = HOPELESS_WINDOWS * WINDOW;
    const told = Array.from({ length: needed }, () => pace.recordRepaint(HOPELESS_MS + 50));
    expect(told.filter(Boolean).length, 'said once').toBe(1);
    expect(told.at(-1)).toBe(true);
    expect(pace.hopeless).toBe(true);
    run(pace, HOPELESS_MS - 10, 2);
    expect(pace.hopeless).toBe(false);
    const fresh = new QualitySteps();
    run(fresh, HOPELESS_MS + 50, ((STEPS.length - 1) * WINDOW * (HOPELESS_MS + 50)) / 1000);
    expect(fresh.step).toEqual(DOWN);
    expect(fresh.hopeless, 'not before all else was tried').toBe(false);
  });

  it.each([
    [400, 24_000],
    [1600, 32_000],
  ])('very slow ones, %i ms a picture, are found out within %i ms', (intervalMs, withinMs) => {
    const pace = new QualitySteps();
    let ms = 0;
    for (; !pace.hopeless && ms < 120_000; ms += intervalMs) pace.recordRepaint(intervalMs);
    expect(ms).toBeLessThanOrEqual(withinMs);
  });

  it('neither slow nor calm: it stays where it is', () => {
    const pace = new QualitySteps();
    run(pace, SLOW_MS + 10, 20);
    expect(run(pace, (SLOW_MS + CALM_MS) / 2, 300)).toBe(0);
    expect(pace.step).toEqual(DOWN);
  });

  it('one that recovers has everything back, a step after each calm', () => {
    const pace = new QualitySteps();
    run(pace, SLOW_MS + 10, 20);
    expect(run(pace, 16, (FIRST_CALM_MS / 1000) * 0.9)).toBe(0);
    expect(run(pace, 16, 120)).toBe(STEPS.length - 1);
    expect(pace.step).toEqual(STEPS[0]);
  });

  it('does not swing where only the lesser picture is fast', () => {
    const pace = new QualitySteps();
    let changes = 0;
    for (let ms = 0; ms < 600_000; ) {
      const intervalMs = pace.step === STEPS[0] ? SLOW_MS + 20 : 16;
      changes += pace.recordRepaint(intervalMs) ? 1 : 0;
      ms += intervalMs;
    }
    expect(changes).toBeLessThan(16); // 8, 16, 32 … s of calm; at even intervals it would be over a hundred
  });

  it('has everything back when it is told to forget', () => {
    const pace = new QualitySteps();
    run(pace, SLOW_MS + 10, 20);
    pace.reset();
    expect(pace.step).toEqual(STEPS[0]);
  });

  it('a tab that was hidden, or one slow repaint, is no slow device', () => {
    const pace = new QualitySteps();
    for (let i = 0; i < 1000; i += 1) {
      expect(pace.recordRepaint(i % 9 === 0 ? 5000 : 16)).toBe(false);
      expect(pace.recordRepaint(i % 5 === 0 ? 400 : 16)).toBe(false);
    }
  });
});
