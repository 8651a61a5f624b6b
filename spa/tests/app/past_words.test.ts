import { describe, expect, it } from 'vitest';
import { noteMarks, noteShownAt, noteWords, TOGETHER_PX } from '../../src/app/pages/recording/Notes.tsx';
import {
  lengthWords,
  lostWords,
  recordedAs,
  unreadableWords,
} from '../../src/app/pages/recording/recording_words.ts';
import { PastWatch } from '../../src/app/past/past_watch.ts';
import { spokenOf } from '../../src/app/past/time_line/spoken.ts';
import { preciseWords } from '../../src/app/past/time_line/TransportBar.tsx';
import { ko } from '../../src/app/text/ko.ts';
import { moreKo } from '../../src/app/text/more_ko.ts';
import { agoWords, momentWords, notKeptWords } from '../../src/app/words/moment.ts';
import { chipWords, stageWords } from '../../src/app/words/status.ts';
import { PastError } from '../../src/past/past_source.ts';
import type { Playhead } from '../../src/past/past_types.ts';
import { IndexError } from '../../src/past/recording/recording_index.ts';
import { isClaim, isOld, isThen } from '../../src/twin/liveness.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { playheadAt } from '../rigs/past_fake.ts';

/** In the local time zone of the test run. */
const FROM_MS = new Date(2026, 10, 12, 14, 0, 0, 0).getTime();
const RECORDED = recordedAs({ fromMs: FROM_MS, toMs: FROM_MS + 1_500_000 }, () => false);
const head = (more: Partial<Playhead> = {}) => playheadAt(FROM_MS + 127_250, { recorded: RECORDED, ...more });
const LINK = { hz: 0, roundTripMs: null, by: 'websocket', phase: 'open', ending: null } as never;
const watchOf = (playhead: Playhead) => {
  const twin = new RobotTwin('demo', 0);
  const nowMs = RECORDED.toMs;
  return new PastWatch(
    twin,
    () => playhead.momentMs,
    () => ({ playhead, nowMs }),
    'RECORDED',
  );
};

describe('a recording says that it is one', () => {
  it('in chip and banner, with date and time in the recording, and no age', () => {
    const verdict = watchOf(head()).verdict();
    expect(verdict).toMatchObject({ word: 'RECORDED', ageMs: null, cause: null });
    const { word, detail, more } = chipWords(verdict, LINK, Date.now());
    expect(`${word} ${detail}${more}`).toBe('RECORDED 12 Nov 2026 14:02:07 · 2:07 of 25:00');
    expect(stageWords({ ...verdict, past: { ...verdict.past!, isHere: true } }, LINK, Date.now())).toBe(
      'Recorded: 12 Nov 2026 14:02:07 · 2:07 of 25:00.',
    );
    expect(stageWords(verdict, LINK, Date.now())).toMatch(/Loading its pose\.$/);
    expect(isClaim(verdict.word)).toBe(false);
    expect(isThen(verdict.word)).toBe(true);
  });

  it('and that the part of a moment is missing, however near the pose before is', () => {
    const playhead = head({
      recorded: recordedAs({ fromMs: FROM_MS, toMs: FROM_MS + 1_500_000 }, (ms) => ms > FROM_MS + 120_000),
    });
    const twin = { state: { atMs: playhead.momentMs - 2000 } } as unknown as RobotTwin;
    const watch = new PastWatch(
      twin,
      () => playhead.momentMs,
      () => ({ playhead, nowMs: RECORDED.toMs }),
      'RECORDED',
    );
    expect(isOld(watch.verdict())).toBe(true);
    expect(stageWords(watch.verdict(), LINK, 0)).toMatch(/This part of the recording is missing\.$/);
  });

  it('with the word of then in second place', () => {
    const watch = watchOf(head());
    watch.was('silent');
    expect(chipWords(watch.verdict(), LINK, 0).more).toBe(' · 2:07 of 25:00 · was STALE');
    expect(isOld(watch.verdict())).toBe(true);
  });

  it('to a screen reader, and in the row of the line', () => {
    expect(spokenOf(head(), RECORDED.toMs).words).toBe('12 Nov 2026 14:02:07, 2:07 of 25:00, playing at 1×');
    expect(preciseWords(head({ playing: false }), RECORDED.toMs)).toBe(
      '12 Nov 2026 14:02:07.25 · 2:07 of 25:00',
    );
  });

  it('and that it has not the moment of a link', () => {
    const asked = head({ note: 'not-kept', askedMs: FROM_MS - 60_000, momentMs: FROM_MS });
    expect(stageWords(watchOf(asked).verdict(), LINK, 0)).toBe(
      'Recorded: 12 Nov 2026 13:59:00 is not in this recording; this is the nearest moment, 14:00:00 · 0:00 of 25:00.',
    );
  });
});

it('lengths are told as players do', () => {
  expect([0, 7000, 65_900, 3_600_000, 100_000_000, -5].map(lengthWords)).toEqual([
    ...['0:00', '0:07', '1:05', '1:00:00', '27:46:40', '0:00'],
  ]);
});

it('what is wrong with a recording is one sentence', () => {
  expect(unreadableWords(new IndexError('newer', 'version'))).toMatch(/newer Posecast/);
  expect(unreadableWords(new IndexError('damaged', 'segments[3]: index'))).toContain('segments[3]: index');
  expect(unreadableWords(new PastError('gone', 'x'))).toMatch(/No recording\.json/);
  expect(unreadableWords(new PastError('away', 'x'))).toMatch(/does not answer/);
  expect(lostWords({ count: 0, isNewer: false }, 750)).toBeNull();
  expect(lostWords({ count: 1, isNewer: false }, 750)).toBe('1 of 750 parts is missing or damaged.');
  expect(lostWords({ count: 3, isNewer: true }, 750)).toBe(
    '3 of 750 parts are missing or damaged. A newer Posecast made some of them.',
  );
});

describe('notes', () => {
  const at = (...seconds: number[]) => seconds.map((s) => ({ atMs: FROM_MS + 1000 * s, text: `${s}` }));

  it('are shown for eight seconds, the newer instead of the older', () => {
    const notes = at(10, 15);
    const shown = (s: number) => noteShownAt(notes, FROM_MS + 1000 * s)?.text ?? null;
    expect([9.9, 10, 14.9, 15, 23, 23.1].map(shown)).toEqual([null, '10', '10', '15', '15', null]);
  });

  it('have marks that a finger can tell apart, and only where they are in view', () => {
    const view = { fromMs: FROM_MS, toMs: FROM_MS + 100_000, widthPx: 274 };
    const marks = noteMarks(at(0, 5, 9, 30, 99, 500), view);
    expect(marks.map(({ notes }) => notes.map(({ text }) => text).join())).toEqual(['0,5,9', '30', '99']);
    marks.slice(1).forEach(({ xPx }, i) => {
      expect(xPx - marks[i]!.xPx).toBeGreaterThanOrEqual(TOGETHER_PX);
    });
  });
});

it('a note keeps its lines, and what is invisible in them is shown', () => {
  expect(noteWords({ atMs: 0, text: 'The left knee.\r\nCompare it\u200b.\n' })).toBe(
    'The left knee.\nCompare it\\u{200b}.',
  );
});

/** In the local time zone of the test run. */
const NOON = new Date(2026, 10, 22, 14, 4, 7, 250).getTime();
const MIN = 60_000;
const headAt = (more: Partial<Playhead>) => playheadAt(NOON, more);

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
    expect(preciseWords(headAt({ playing: false }), NOON + 2 * MIN)).toBe('14:04:07.25 · 2 min ago');
    expect(preciseWords(headAt({}), NOON + 2 * MIN)).toBe('14:04:07 · 2 min ago');
  });

  it('is told to a screen reader with how it plays', () => {
    expect(spokenOf(headAt({ speed: 0.5 }), NOON + 2 * MIN)).toEqual({
      ...{ words: '14:04:07, 2 min ago, playing at ½×', agoS: 120 },
    });
    expect(spokenOf(headAt({ playing: false }), NOON + 2 * MIN).words).toBe('14:04:07, 2 min ago, paused');
    expect(spokenOf(headAt({ at: 'live' }), NOON)).toEqual({ words: 'Live', agoS: 0 });
  });
});
