import type { Threshold } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { moreEn } from '../../src/app/text/more_en.ts';
import {
  editsText,
  LevelLatch,
  NO_EDITS,
  rangeWords,
  readEdits,
  ValueLimits,
  whyNoThreshold,
  withEdit,
} from '../../src/twin/limits.ts';
import { SCHEMA } from '../rigs/schema.ts';

const FOOT: Threshold = { low: -30, high: 500, caution: 0.5 };

/** The levels of one channel, value by value. */
function levels(threshold: Threshold | null, values: readonly (number | null)[]): string[] {
  const latch = new LevelLatch();
  return values.map((value) => latch.next(threshold, value));
}

describe('a level with hysteresis', () => {
  it('rises at once, on either side', () => {
    expect(levels(FOOT, [0, 251, 501, 0, -16, -31])).toEqual([
      'ok',
      'caution',
      'fault',
      'ok',
      'caution',
      'fault',
    ]);
  });

  it('falls only a twentieth of the limit further in', () => {
    expect(levels(FOOT, [501, 499, 476, 474, 251, 240, 226, 224])).toEqual([
      ...['fault', 'fault', 'fault', 'caution', 'caution', 'caution', 'caution', 'ok'],
    ]);
  });

  it('does not flicker when noise of a few newtons crosses the limit again and again', () => {
    const noisy = Array.from({ length: 200 }, (_, i) => 500 + (i % 2 === 0 ? 4 : -4));
    expect(new Set(levels(FOOT, noisy).slice(1))).toEqual(new Set(['fault']));
  });

  it('lets a foot in the air be well again: the margin of one side is no matter of the other', () => {
    expect(levels(FOOT, [300, 0, -1, 1])).toEqual(['caution', 'ok', 'ok', 'ok']);
  });

  it('is ok without limits and without a reading, and forgets what it held', () => {
    expect(levels(null, [1e9])).toEqual(['ok']);
    expect(levels(FOOT, [501, null, 490, Number.NaN])).toEqual(['fault', 'ok', 'caution', 'ok']);
  });

  it('starts anew with another limit', () => {
    const latch = new LevelLatch();
    expect(latch.next(FOOT, 501)).toBe('fault');
    expect(latch.next({ ...FOOT, high: 520 }, 501)).toBe('caution');
  });
});

describe('limits', () => {
  it('are the viewer’s own before those of the profile, label by label', () => {
    const mine = { low: null, high: 100, caution: 1 };
    const limits = new ValueLimits(SCHEMA.mapping, withEdit(NO_EDITS, 'ftf', 'RF.fz', mine));
    expect(limits.threshold('ftf', 'RF.fz')).toEqual(mine);
    expect(limits.profile('ftf', 'RF.fz')).toEqual({ low: null, high: 500, caution: 0.5 });
    expect(limits.threshold('temp', 'LKN')?.high).toBe(70);
    expect(limits.edited('ftf', 'RF.fz')).toBe(true);
    expect(limits.edited('temp', 'LKN')).toBe(false);
  });

  it('go back to the profile when an edit is taken away', () => {
    const edits = withEdit(NO_EDITS, 'ftf', 'RF.fz', FOOT);
    const back = withEdit(edits, 'ftf', 'RF.fz', null);
    expect(back.size).toBe(0);
    expect(new ValueLimits(SCHEMA.mapping, back).threshold('ftf', 'RF.fz')?.high).toBe(500);
    expect(edits.size, 'the edits before are left alone').toBe(1);
  });

  it('say in one sentence why they can’t be watched', () => {
    expect(whyNoThreshold(FOOT)).toBeNull();
    expect(whyNoThreshold({ low: 5, high: 5, caution: 1 })).toBe('limitsCrossed');
    expect(whyNoThreshold({ low: null, high: null, caution: 1 })).toBe('limitMissing');
    expect(whyNoThreshold({ low: Number.NaN, high: null, caution: 1 })).toBe('limitNoNumber');
    expect(whyNoThreshold({ low: 0, high: 1, caution: 0 })).toBe('limitCaution');
  });

  it('survive storage, whatever it holds', () => {
    const edits = withEdit(withEdit(NO_EDITS, 'ftf', 'RF.fz', FOOT), 'temp', 'LKN', { ...FOOT, low: null });
    expect(readEdits(editsText(edits))).toEqual(edits);
    for (const odd of [null, '', '{', '7', '[]', '{"ftf":3}', '{"ftf":{"RF.fz":null}}']) {
      expect(readEdits(odd).size).toBe(0);
    }
    const mixed = '{"ftf":{"a":{"low":"x"},"b":{"low":9,"high":1},"c":{"high":4},"d":{"high":1e999}}}';
    expect([...(readEdits(mixed).get('ftf') ?? [])]).toEqual([['c', { low: null, high: 4, caution: 1 }]]);
  });
});

it('limits are said as a person says them', () => {
  const said = (low: number | null, high: number | null) =>
    rangeWords({ low, high, caution: 1 }, (value) => `${value} N`, moreEn);
  expect([said(-5, 5), said(-30, 500), said(null, 70), said(10, null)]).toEqual([
    ...['±5 N', '-30 N to 500 N', 'at most 70 N', 'at least 10 N'],
  ]);
});
