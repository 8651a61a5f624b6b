import { describe, expect, it } from 'vitest';
import { spokenOf } from '../../src/app/past/time_line/spoken.ts';
import { preciseWords } from '../../src/app/past/time_line/TransportBar.tsx';
import { ko } from '../../src/app/text/ko.ts';
import { moreKo } from '../../src/app/text/more_ko.ts';
import { agoWords, momentWords, notKeptWords } from '../../src/app/words/moment.ts';
import type { Playhead } from '../../src/past/past_types.ts';
import { playheadAt } from '../rigs/past_fake.ts';

/** In the local time zone of the test run. */
const NOON = new Date(2026, 10, 22, 14, 4, 7, 250).getTime();
const MIN = 60_000;
const head = (more: Partial<Playhead>) => playheadAt(NOON, more);

describe('a moment in words', () => {
  it('is a time and how long ago it was', () => {
    expect(momentWords(NOON, NOON + 2 * MIN)).toBe('14:04:07 · 2 min ago');
    expect(momentWords(NOON, NOON)).toBe('14:04:07 · 1 s ago');
    expect(agoWords(9400)).toBe('9 s ago');
    expect(agoWords(30_000)).toBe('30 s ago');
  });

  it('has a date if it was not today, and a year if not this one', () => {
    const day = 24 * 60 * MIN;
    expect(momentWords(NOON, NOON + 10 * 60 * MIN)).toBe('22 Nov 14:04:07 · 10 h ago');
    expect(momentWords(NOON, NOON + 90 * day)).toBe('22 Nov 2026 14:04:07 · 90 days ago');
  });

  it('is told in Korean in Korean order', () => {
    expect(moreKo.date('11월', 22, null)).toBe('11월 22일');
    expect(moreKo.date('11월', 22, 2026)).toBe('2026년 11월 22일');
    expect(moreKo.ago(ko.seconds(8))).toBe('8초 전');
    expect(moreKo.ago(ko.minutes(30))).toBe('30분 전');
    expect(moreKo.ago(ko.hours(2))).toBe('2시간 전');
  });

  it('names the moment that a link asks for, with its day, where it is not kept', () => {
    expect(notKeptWords(NOON - 30 * MIN, NOON, NOON + MIN)).toBe(
      '22 Nov 13:34:07 is no longer kept; this is the oldest moment, 14:04:07',
    );
    expect(notKeptWords(NOON, NOON, NOON + MIN)).toBe(
      '22 Nov 14:04:07 was not recorded; this is the nearest moment, 14:04:07',
    );
  });

  it('has hundredths where it rests', () => {
    expect(preciseWords(head({ playing: false }), NOON + 2 * MIN)).toBe('14:04:07.25 · 2 min ago');
    expect(preciseWords(head({}), NOON + 2 * MIN)).toBe('14:04:07 · 2 min ago');
  });

  it('is told to a screen reader with how it plays', () => {
    expect(spokenOf(head({ speed: 0.5 }), NOON + 2 * MIN)).toEqual({
      ...{ words: '14:04:07, 2 min ago, playing at ½×', agoS: 120 },
    });
    expect(spokenOf(head({ playing: false }), NOON + 2 * MIN).words).toBe('14:04:07, 2 min ago, paused');
    expect(spokenOf(head({ at: 'live' }), NOON)).toEqual({ words: 'Live', agoS: 0 });
  });
});
