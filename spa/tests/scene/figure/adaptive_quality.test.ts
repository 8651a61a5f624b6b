import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import {
  AdaptiveQuality,
  type DrawingTrouble,
  PATIENCE_MS,
} from '../../../src/scene/figure/adaptive_quality.ts';
import { HOPELESS_MS, type QualityStep } from '../../../src/scene/figure/quality_steps.ts';

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

function device(replaceable = true) {
  const said: (DrawingTrouble | null)[] = [];
  let step: QualityStep | null = null;
  const quality = new AdaptiveQuality({
    applyStep: (now) => {
      step = now;
    },
    isCoarse: () => step?.lowest === true,
    isReplaceable: () => replaceable,
    report: (trouble) => said.push(trouble),
  });
  return { quality, said, step: () => step };
}

const crawl = (quality: AdaptiveQuality) => {
  for (let i = 0; i < 200; i += 1) quality.recordRepaint(HOPELESS_MS + 50);
};

it('gives up pixels, then detail, and when that does not suffice says that the light view should take over', () => {
  const { quality, said, step } = device();
  crawl(quality);
  expect(said.filter((trouble, i) => trouble !== said[i - 1])).toEqual(['pixels', 'detail', 'hopeless']);
  expect(step()?.lowest).toBe(true);
  expect(quality.pixels).toBeLessThan(1);
  quality.reset();
  expect(said.at(-1)).toBeNull();
  expect(quality.pixels).toBe(1);
});

it('stays as it is where nothing could take its place', () => {
  const { quality, said } = device(false);
  crawl(quality);
  expect(said).not.toContain('hopeless');
  expect(said.at(-1)).toBe('detail');
});

it('waits for a lost context, so long and so often, and then gives up', () => {
  const { quality, said } = device();
  quality.contextLost(0);
  quality.contextRestored();
  expect(said).toEqual(['lost', null]);
  vi.advanceTimersByTime(2 * PATIENCE_MS);
  expect(said.length).toBe(2);
  quality.contextLost(1000);
  vi.advanceTimersByTime(2 * PATIENCE_MS);
  expect(said.slice(2)).toEqual(['lost', 'failed']);
  quality.contextLost(2000);
  quality.contextRestored();
  quality.contextLost(3000);
  expect(said.at(-1), 'the fourth within two minutes').toBe('failed');
});

it('says of a context that is gone that it is gone, however slow the repaints before were', () => {
  const { quality, said } = device();
  quality.contextLost(0);
  crawl(quality);
  quality.reset();
  expect(said).toEqual(['lost']);
  crawl(quality);
  quality.contextRestored();
  expect(said.at(-1)).toBe('hopeless');
});

it('is done with once it is disposed of', () => {
  const { quality, said } = device();
  quality.contextLost(0);
  quality.dispose();
  vi.advanceTimersByTime(2 * PATIENCE_MS);
  expect(said).toEqual(['lost']);
});
