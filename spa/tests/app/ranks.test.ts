import { describe, expect, it } from 'vitest';
import { Ranks } from '../../src/app/numbers/table/joint_row.ts';

describe('the rank of a row', () => {
  it('is the top while it is faulty, and for five seconds after', () => {
    const ranks = new Ranks(2);
    ranks.set(1, 'fault', false);
    expect([ranks.of(0, 0), ranks.of(1, 0)]).toEqual([0, 2]);
    ranks.set(1, 'ok', false);
    expect([4999, 5000].map((ms) => ranks.of(1, ms))).toEqual([2, 0]);
  });

  it('is the top as long as a fault of it waits to be acknowledged, and five seconds from its end', () => {
    const ranks = new Ranks(1);
    ranks.set(0, 'fault', true);
    ranks.of(0, 0);
    ranks.set(0, 'ok', true);
    expect(ranks.of(0, 60_000)).toBe(2);
    ranks.set(0, 'ok', false);
    expect(ranks.of(0, 60_001)).toBe(0);
    ranks.set(0, 'fault', true);
    ranks.of(0, 70_000);
    ranks.set(0, 'ok', false);
    expect(ranks.of(0, 71_000)).toBe(2);
  });

  it('rises for a caution only when it has lasted a second, also with gaps', () => {
    const ranks = new Ranks(1);
    ranks.set(0, 'caution', false);
    expect([0, 999, 1000].map((ms) => ranks.of(0, ms))).toEqual([0, 0, 1]);
    ranks.set(0, 'ok', false);
    expect([5999, 6000].map((ms) => ranks.of(0, ms))).toEqual([1, 0]);
    ranks.set(0, 'caution', false);
    expect(ranks.of(0, 6001), 'a new one').toBe(0);
  });
});
