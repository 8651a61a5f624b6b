import { expect, it } from 'vitest';
import { ContextLossPolicy, MOST_LOSSES, WITHIN_MS } from '../../../src/scene/figure/adaptive_quality.ts';

it('a context may be lost three times, not a fourth', () => {
  const policy = new ContextLossPolicy();
  for (let i = 0; i < MOST_LOSSES; i += 1) expect(policy.recordLoss(i * 1000)).toBe(true);
  expect(policy.recordLoss(5000)).toBe(false);
  expect(policy.recordLoss(6000)).toBe(false);
});

it('losses of long ago are forgotten', () => {
  const policy = new ContextLossPolicy();
  for (let i = 0; i < 20; i += 1) expect(policy.recordLoss((i * WITHIN_MS) / MOST_LOSSES)).toBe(true);
});
