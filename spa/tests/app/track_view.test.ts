import { describe, expect, it } from 'vitest';
import { ALL } from '../../src/app/past/time_line/line.ts';
import { goingOn, movementPath, runsOf } from '../../src/app/past/time_line/movement.ts';
import { whatWords } from '../../src/app/past/time_line/Track.tsx';
import { drawnMarks, drawnWords } from '../../src/app/past/time_line/TrackPicture.tsx';
import { markNear, msAt, pxAt, shownSpan } from '../../src/app/past/time_line/track_view.ts';
import { relayAhead } from '../../src/past/player/playhead_state.ts';
import { timelineOf } from '../rigs/past_fake.ts';

const MIN = 60_000;
const RECENT_MS = 5 * MIN;
const T = Date.UTC(2026, 10, 22, 14, 30);
/** Ten minutes over 600 px between the pads: a pixel is a second. */
const VIEW = { fromMs: T - 10 * MIN, toMs: T, widthPx: 614 };

describe('places on the track', () => {
  it('are moments, and none lies beyond its ends', () => {
    expect([pxAt(VIEW, VIEW.fromMs), pxAt(VIEW, VIEW.toMs)]).toEqual([7, 607]);
    expect(msAt(VIEW, 7 + 60)).toBe(VIEW.fromMs + MIN);
    expect([msAt(VIEW, -50), msAt(VIEW, 900)]).toEqual([VIEW.fromMs, VIEW.toMs]);
  });
});

describe('the shown span', () => {
  const whole = { fromMs: T - 30 * MIN, toMs: T };
  const newest = { fromMs: T - RECENT_MS, toMs: T };

  it('is all there is, but never less than a minute', () => {
    expect(shownSpan(whole, ALL, T, null)).toEqual(whole);
    expect(shownSpan({ fromMs: T - 20_000, toMs: T }, ALL, T, null)).toEqual({ fromMs: T - MIN, toMs: T });
  });

  it('is the newest five minutes as long as the playhead is in them', () => {
    expect(shownSpan(whole, RECENT_MS, T, null)).toEqual(newest);
    expect(shownSpan(whole, RECENT_MS, T - 5 * MIN, whole)).toEqual(newest);
  });

  it('is elsewhere a page with the playhead, which stands still until the playhead leaves it', () => {
    const page = shownSpan(whole, RECENT_MS, T - 20 * MIN, whole);
    expect(page.toMs - page.fromMs).toBe(RECENT_MS);
    expect(shownSpan({ ...whole, toMs: T + MIN }, RECENT_MS, T - 18 * MIN, page)).toBe(page);
    const next = shownSpan(whole, RECENT_MS, page.toMs + 1, page);
    expect(next.fromMs).toBeGreaterThan(page.toMs - MIN);
    const back = shownSpan(whole, RECENT_MS, page.fromMs - 1, page);
    expect(back.toMs).toBeLessThan(page.fromMs + MIN);
  });

  it('does not reach before the oldest or behind now', () => {
    expect(shownSpan(whole, RECENT_MS, whole.fromMs + 1000, whole).fromMs).toBe(whole.fromMs);
    const page = { fromMs: T - 11 * MIN, toMs: T - 6 * MIN };
    expect(shownSpan(whole, RECENT_MS, T - 5.5 * MIN, page).toMs).toBeLessThanOrEqual(T);
  });
});

describe('the curve of movement', () => {
  const part = (fromS: number, toS: number, bytesPerS: number) => ({
    ...{ fromMs: T + fromS * 1000, toMs: T + toS * 1000, bytesPerS },
  });

  it('goes on as it was up to what this page was shown, and no further than is likely', () => {
    const line = {
      ...{ fromMs: T - MIN, toMs: T - 18_000, movement: [part(-60, -18, 7)], words: [], marks: [] },
    };
    expect(runsOf(goingOn(line, T).movement, 1000)).toMatchObject([{ fromMs: T - MIN, toMs: T }]);
    expect(goingOn(line, T)).toMatchObject({ toMs: T });
    expect(goingOn(line, T - 20_000)).toBe(line);
    expect(goingOn(line, T + 5 * MIN)).toBe(line);
    const silent = { ...line, words: [{ fromMs: T - 20_000, toMs: T - 18_000, word: 'silent' as const }] };
    expect(goingOn(silent, T)).toBe(silent);
    const ended = { ...line, movement: [part(-60, -40, 7)] };
    expect(goingOn(ended, T)).toBe(ended);
  });

  it('breaks where nothing was recorded', () => {
    const runs = runsOf([part(-60, -50, 1), part(-50, -40, 1), part(-30, -20, 1)], 1000);
    expect(runs.map(({ fromMs, toMs }) => [fromMs - T, toMs - T])).toEqual([
      [-60_000, -40_000],
      [-30_000, -20_000],
    ]);
    const path = movementPath([part(-60, -40, 1), part(-30, -20, 1)], VIEW, {
      ...{ basePx: 30, heightPx: 20, mostBytesPerS: 1 },
    });
    expect(path.match(/M/g)).toHaveLength(2);
    expect(path).toMatch(/^M547 30V10.*L567 10V30ZM577 30/);
  });

  it('takes means over what is drawn as one, by duration', () => {
    const [run] = runsOf([part(0, 1, 100), part(1, 4, 500)], 1_000_000);
    expect(run?.points).toEqual([{ atMs: T + 2000, bytesPerS: 400 }]);
  });

  it('is on a square-root scale, and seen where nothing moved', () => {
    const high = (bytesPerS: number) =>
      movementPath([part(-60, -40, bytesPerS)], VIEW, { basePx: 30, heightPx: 20, mostBytesPerS: 400 });
    expect(high(400)).toContain('V10');
    expect(high(100)).toContain('V20');
    expect(high(0)).toContain('V28.5');
  });

  it('does not cost what is not shown', () => {
    const out = movementPath([part(-3600, -3000, 9)], VIEW, { basePx: 30, heightPx: 20, mostBytesPerS: 9 });
    expect(out).toBe('');
  });
});

it('draws no more than has room, however often something begins and ends', () => {
  const every = Array.from({ length: 20_000 }, (_, i) => T - 600_000 + 30 * i);
  const words = every.map((fromMs, i) => ({
    ...{ fromMs, toMs: fromMs + 20 },
    word: i % 2 === 0 ? ('silent' as const) : ('offline' as const),
  }));
  expect(drawnWords(words, VIEW).length).toBeLessThan(5 * VIEW.widthPx);
  expect(drawnWords(words.slice(-3, -2), VIEW)).toHaveLength(1);
  const hours = { fromMs: T - 200_000_000, toMs: T, widthPx: 600 };
  const movement = Array.from({ length: 100_000 }, (_, i) => {
    const fromMs = hours.fromMs + 2000 * i;
    return { fromMs, toMs: fromMs + 1000, bytesPerS: 1 };
  });
  const path = movementPath(movement, hours, { basePx: 30, heightPx: 20, mostBytesPerS: 1 });
  expect(path.length).toBeLessThan(100_000);
});

describe('marks', () => {
  const timeline = timelineOf(T, 10, [
    { atMs: T - 300_000, level: 'caution', text: 'tempHigh' },
    { atMs: T - 298_000 },
    { atMs: T - 297_000 },
    { atMs: T - 120_000, exact: false },
    { atMs: T - 60_000, exact: false },
    { atMs: T - 60_000 },
    { atMs: T - 3_600_000 },
  ]);

  it('are drawn as one where they would lie over one another, faults last', () => {
    const drawn = drawnMarks(timeline.marks, VIEW);
    expect(drawn.map(({ level, xPx, exact }) => [level, xPx, exact])).toEqual([
      ['caution', 307, true],
      ['fault', 309, true],
      ['fault', 487, false],
      ['fault', 547, true],
    ]);
    expect(drawn.map(({ count }) => count)).toEqual([1, 2, 1, 2]);
  });

  it('are meant by taps within 10 px, faults before cautions', () => {
    expect(markNear(timeline.marks, VIEW, 301)?.atMs).toBe(T - 298_000);
    expect(markNear(timeline.marks, VIEW, 298)?.level).toBe('caution');
    expect(markNear(timeline.marks, VIEW, 296)).toBeNull();
  });

  it('are told with what else there was', () => {
    const said = (xPx: number) =>
      whatWords(timeline, VIEW, xPx, msAt(VIEW, xPx)).replace(/[\u2068\u2069]/g, '');
    expect(said(309)).toBe('RKN jam and 2 more');
    expect(said(487)).toBe('a fault in this minute');
    expect(said(400)).toBe('');
  });

  it('give way to the words of then, and to what was not recorded', () => {
    const silent = { fromMs: T - 200_000, toMs: T - 190_000, word: 'silent' } as const;
    const [whole] = timeline.movement;
    const movement = [
      { ...whole!, toMs: T - 210_000 },
      { ...whole!, fromMs: T - 100_000, toMs: T - 5000 },
    ];
    const line = { ...timeline, movement, words: [silent] };
    const said = (agoS: number) => whatWords(line, VIEW, 607 - agoS, T - agoS * 1000);
    expect([195, 160, 40, 2].map(said)).toEqual(['STALE', 'not recorded', '', '']);
    const unknown = [{ fromMs: T - 170_000, toMs: T - 150_000 }];
    expect(whatWords({ ...line, unknown }, VIEW, 607 - 160, T - 160_000), 'it is not known').toBe('');
  });
});

describe('now by the relay’s clock', () => {
  const live = (momentMs: number) => ({ at: 'live', momentMs }) as const;

  it('is as far ahead as the newest moment was when it was newest', () => {
    let ahead = relayAhead(Number.NEGATIVE_INFINITY, { toMs: 0 }, live(T + 5000), T);
    expect(ahead).toBe(5000);
    ahead = relayAhead(ahead, { toMs: T + 5000 }, live(T + 5000), T + 60_000);
    expect(ahead).toBe(5000);
  });

  it('is the page’s own where the newest moment is long past', () => {
    expect(relayAhead(Number.NEGATIVE_INFINITY, { toMs: T - 600_000 }, live(T - 600_000), T)).toBe(0);
    expect(relayAhead(Number.NEGATIVE_INFINITY, { toMs: T - 3000 }, live(T - 3000), T)).toBe(-3000);
    const past = { at: 'past', momentMs: T + 9000 } as const;
    expect(relayAhead(Number.NEGATIVE_INFINITY, { toMs: T }, past, T)).toBe(0);
  });
});
