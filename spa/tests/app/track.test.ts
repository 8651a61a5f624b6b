import type { EventMessage } from '@posecast/wire';
import { beforeEach, describe, expect, it } from 'vitest';
import { ALL } from '../../src/app/past/time_line/line.ts';
import { goingOn, movementPath, runsOf, withHeard } from '../../src/app/past/time_line/movement.ts';
import { Scrubber } from '../../src/app/past/time_line/scrubber.ts';
import { whatWords } from '../../src/app/past/time_line/Track.tsx';
import { drawnMarks, drawnWords } from '../../src/app/past/time_line/TrackPicture.tsx';
import { markNear, msAt, pxAt, shownSpan } from '../../src/app/past/time_line/track_view.ts';
import type { PastSource } from '../../src/past/past_source.ts';
import type { Span } from '../../src/past/past_types.ts';
import { relayAhead } from '../../src/past/player/playhead_state.ts';
import { listEvents } from '../../src/past/player/tape/happenings.ts';
import { FakePast, timelineOf } from '../rigs/past_fake.ts';

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

const TO_MS = Date.UTC(2026, 10, 22, 14, 10);

function heardAt(n: number, beforeMs: number, more: Partial<EventMessage> = {}): EventMessage {
  const at = (TO_MS - beforeMs) / 1000;
  return { type: 'event', n, t: 0, at, level: 'fault', source: 'RKN', text: 'jam', state: 'on', ...more };
}
const placesOf = (marks: readonly { atMs: number; exact: boolean }[]) =>
  marks.map(({ atMs, exact }) => [TO_MS - atMs, exact]);

it('what was heard stands at its moment, in place of the minutes that tell of it', () => {
  const timeline = timelineOf(TO_MS, 10, [
    { atMs: TO_MS - 5 * MIN, exact: false, count: 2 },
    { atMs: TO_MS - 2 * MIN, exact: false },
  ]);
  const heard = [
    heardAt(7, 4.5 * MIN),
    heardAt(8, 3.5 * MIN, { state: 'off' }),
    heardAt(9, 1.5 * MIN, { level: 'info' }),
    heardAt(10, 1.2 * MIN),
    heardAt(11, 20_000, { level: 'caution' }),
  ];
  // the first minute started before the first event heard, so it stays
  expect(placesOf(withHeard(timeline, heard).marks)).toEqual([
    [5 * MIN, false],
    [1.2 * MIN, true],
    [20_000, true],
  ]);
});

it('what the index tells exactly is not marked twice, and where nothing is new the line is the same', () => {
  const timeline = timelineOf(TO_MS, 10, [{ atMs: TO_MS - 30_000 }]);
  expect(withHeard(timeline, [heardAt(1, 30_400)])).toBe(timeline);
  expect(withHeard(timeline, [])).toBe(timeline);
  expect(withHeard(timeline, [heardAt(1, 11 * MIN), heardAt(2, 30_400)])).toBe(timeline);
  expect(withHeard(timeline, [heardAt(1, 30_400, { text: 'hot' })]).marks).toHaveLength(2);
});

it('where events are lacking, minutes before the gap stay', () => {
  const timeline = timelineOf(TO_MS, 10, [{ atMs: TO_MS - 3 * MIN, exact: false }]);
  const heard = [heardAt(1, 8 * MIN), heardAt(5, MIN)];
  expect(placesOf(withHeard(timeline, heard).marks)).toEqual([
    [3 * MIN, false],
    [MIN, true],
  ]);
});

it('what was heard is listed before a segment has it, and once', () => {
  const recorded = { ...heardAt(1, MIN), atMs: TO_MS - MIN };
  const source = { segmentsIn: () => [{ events: [recorded] }] } as unknown as PastSource;
  const span = { fromMs: TO_MS - 2 * MIN, toMs: TO_MS };
  const heard = [heardAt(0, 3 * MIN), heardAt(1, MIN), heardAt(2, 5000), heardAt(3, 4000, { at: null })];
  expect(listEvents(source, heard, span).map(({ n, atMs }) => [n, TO_MS - atMs])).toEqual([
    [1, MIN],
    [2, 5000],
  ]);
});

/** The place of so many seconds ago. */
const ago = (s: number) => 607 - s;

let past: FakePast;
let frames: (() => void)[];
let drafts: (Span | null)[];
let scrubber: Scrubber;

beforeEach(() => {
  past = new FakePast(T, timelineOf(T, 10, [{ atMs: T - 300_000 }]));
  frames = [];
  drafts = [];
  scrubber = new Scrubber(
    past,
    (run) => {
      frames.push(run);
      return () => frames.splice(frames.indexOf(run), 1);
    },
    (draft) => drafts.push(draft),
  );
});

const press = (xPx: number, how: { shift?: boolean; touch?: boolean } = {}) =>
  scrubber.down(VIEW, T, { xPx, shift: false, touch: false, ...how });
const draw = () => {
  for (const frame of frames.splice(0)) frame();
};

describe('a tap on the track', () => {
  it('goes to its moment, and settles there', () => {
    press(ago(100));
    scrubber.up(ago(101));
    expect(past.told).toEqual(['attend', 'scrub 100', 'settle']);
  });

  it('near a fault goes to two seconds before it', () => {
    press(ago(292));
    scrubber.up(ago(292));
    expect(past.told).toEqual(['attend', 'scrub 302', 'settle']);
  });

  it('at the right end goes back to live', () => {
    press(ago(1));
    scrubber.up(ago(1));
    expect(past.told.at(-1)).toBe('live');
    expect(past.told).not.toContain('settle');
  });
});

describe('a drag', () => {
  it('seeks once a frame, and last where it ends', () => {
    press(ago(100));
    for (const s of [110, 120, 130]) scrubber.move(ago(s));
    expect(past.told).toEqual(['attend', 'scrub 100']);
    draw();
    scrubber.move(ago(140));
    scrubber.up(ago(150));
    expect(past.told).toEqual(['attend', 'scrub 100', 'scrub 130', 'scrub 150', 'settle']);
    draw();
    scrubber.move(ago(10));
    expect(past.told.at(-1)).toBe('settle');
  });

  it('settles if the system takes it away, and only once', () => {
    press(ago(100));
    scrubber.move(ago(200));
    scrubber.cancel();
    scrubber.cancel();
    expect(past.told).toEqual(['attend', 'scrub 100', 'scrub 200', 'settle']);
    expect(scrubber.held).toBe(false);
  });

  it('that passes a fault does not snap to it', () => {
    press(ago(100));
    scrubber.move(ago(301));
    scrubber.up(ago(301));
    expect(past.told).toContain('scrub 301');
  });
});

describe('a loop', () => {
  it('is drawn with Shift in either direction, and begins where it was drawn', () => {
    press(ago(100), { shift: true });
    scrubber.move(ago(130));
    expect(drafts.at(-1)).toEqual({ fromMs: T - 130_000, toMs: T - 100_000 });
    expect(past.told).toEqual([]);
    scrubber.up(ago(140));
    expect(past.told).toEqual(['loop 140 to 100', 'seek 140']);
    expect(drafts.at(-1)).toBeNull();
  });

  it('leaves a playhead that is in it where it is', () => {
    past.rest(120);
    press(ago(100), { shift: true });
    scrubber.up(ago(140));
    expect(past.told).toEqual(['loop 140 to 100']);
  });

  it('is not made by a click', () => {
    press(ago(100), { shift: true });
    scrubber.up(ago(100));
    expect(past.told).toEqual([]);
  });

  it('is changed at its ends, which a finger need not hit so well', () => {
    past.rest(120);
    past.set({ loop: { fromMs: T - 140_000, toMs: T - 100_000 } });
    press(ago(150), { touch: true });
    scrubber.up(ago(160));
    expect(past.told).toEqual(['loop 160 to 100']);
    press(ago(91));
    scrubber.up(ago(91));
    expect(past.told.slice(1)).toEqual(['attend', 'scrub 91', 'settle']);
  });
});
