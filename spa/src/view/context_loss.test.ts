import { expect, it } from 'vitest';
import { Losses, MOST_LOSSES, WITHIN_MS } from './context_loss.ts';

it('a context may be lost three times, not a fourth', () => {
  const losses = new Losses();
  for (let i = 0; i < MOST_LOSSES; i += 1) expect(losses.bearable(i * 1000)).toBe(true);
  expect(losses.bearable(5000)).toBe(false);
  expect(losses.bearable(6000)).toBe(false);
});

it('losses of long ago are forgotten', () => {
  const losses = new Losses();
  for (let i = 0; i < 20; i += 1) expect(losses.bearable((i * WITHIN_MS) / MOST_LOSSES)).toBe(true);
});
