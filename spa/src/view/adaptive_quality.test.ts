import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { Stamina, type Trouble } from './adaptive_quality.ts';
import { PATIENCE_MS } from './context_loss.ts';
import { HOPELESS_MS, type Step } from './quality_steps.ts';

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

function device(replaceable = true) {
  const said: (Trouble | null)[] = [];
  let step: Step | null = null;
  const stamina = new Stamina({
    keep: (now) => {
      step = now;
    },
    coarse: () => step?.lowest === true,
    replaceable: () => replaceable,
    say: (trouble) => said.push(trouble),
  });
  return { stamina, said, step: () => step };
}

const crawl = (stamina: Stamina) => {
  for (let i = 0; i < 200; i += 1) stamina.took(HOPELESS_MS + 50);
};

it('gives up pixels, then detail, and when that does not suffice says that the light view should take over', () => {
  const { stamina, said, step } = device();
  crawl(stamina);
  expect(said.filter((trouble, i) => trouble !== said[i - 1])).toEqual(['pixels', 'detail', 'hopeless']);
  expect(step()?.lowest).toBe(true);
  expect(stamina.pixels).toBeLessThan(1);
  stamina.forget();
  expect(said.at(-1)).toBeNull();
  expect(stamina.pixels).toBe(1);
});

it('stays as it is where nothing could take its place', () => {
  const { stamina, said } = device(false);
  crawl(stamina);
  expect(said).not.toContain('hopeless');
  expect(said.at(-1)).toBe('detail');
});

it('waits for a lost context, so long and so often, and then gives up', () => {
  const { stamina, said } = device();
  stamina.lost(0);
  stamina.restored();
  expect(said).toEqual(['lost', null]);
  vi.advanceTimersByTime(2 * PATIENCE_MS);
  expect(said.length).toBe(2);
  stamina.lost(1000);
  vi.advanceTimersByTime(2 * PATIENCE_MS);
  expect(said.slice(2)).toEqual(['lost', 'failed']);
  stamina.lost(2000);
  stamina.restored();
  stamina.lost(3000);
  expect(said.at(-1), 'the fourth within two minutes').toBe('failed');
});

it('says of a context that is gone that it is gone, however slow the repaints before were', () => {
  const { stamina, said } = device();
  stamina.lost(0);
  crawl(stamina);
  stamina.forget();
  expect(said).toEqual(['lost']);
  crawl(stamina);
  stamina.restored();
  expect(said.at(-1)).toBe('hopeless');
});

it('is done with once it is disposed of', () => {
  const { stamina, said } = device();
  stamina.lost(0);
  stamina.dispose();
  vi.advanceTimersByTime(2 * PATIENCE_MS);
  expect(said).toEqual(['lost']);
});
