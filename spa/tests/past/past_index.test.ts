import { describe, expect, it } from 'vitest';
import { readDay, readPage, readSummary } from '../../src/past/relay/past_documents.ts';
import { PastIndex } from '../../src/past/relay/past_index.ts';
import { entry, event, minute, summary } from '../rigs/past_rig.ts';

const at = (time: string) => Date.parse(`2026-11-22T${time}Z`);
const DAY = at('00:00:00');
const PAGE = at('14:20:00');
const damaged = (says: RegExp) =>
  expect.objectContaining({ why: 'damaged', message: expect.stringMatching(says) });

function indexOf(fromMs: number, toMs: number, minutes: readonly unknown[] = []): PastIndex {
  const index = new PastIndex();
  index.setSummary(readSummary(summary(fromMs, toMs)));
  index.setDay(DAY, readDay({ minutes }, DAY), toMs);
  return index;
}

function add(index: PastIndex, pageMs: number, segments: readonly unknown[], more = false): number {
  return index.addPage(
    pageMs,
    readPage({ segments, more }, pageMs),
    400,
    index.findKnownMs(pageMs, index.toMs),
  );
}

describe('the time line', () => {
  it('is drawn of minutes at first, with gaps where nothing was recorded', () => {
    const index = indexOf(at('14:20:30'), at('14:23:30'), [
      minute('2026-11-22T14:20Z', { bytes: 30_000, faults: 3 }),
      minute('2026-11-22T14:21Z', { word: 'silent' }),
      minute('2026-11-22T14:23Z', { bytes: 60_000 }),
    ]);
    expect(index.timeline).toEqual({
      fromMs: at('14:20:30'),
      toMs: at('14:23:30'),
      movement: [
        { fromMs: at('14:20:30'), toMs: at('14:21:00'), bytesPerS: 1000 },
        { fromMs: at('14:21:00'), toMs: at('14:22:00'), bytesPerS: 1000 },
        { fromMs: at('14:23:00'), toMs: at('14:23:30'), bytesPerS: 2000 },
      ],
      words: [{ fromMs: at('14:21:00'), toMs: at('14:22:00'), word: 'silent' }],
      marks: [{ atMs: at('14:20:30'), level: 'fault', source: '', text: '', exact: false, count: 3 }],
    });
  });

  it('is drawn of segments where their page was fetched', () => {
    const minutes = ['14:19', '14:20', '14:21'].map((time) => minute(`2026-11-22T${time}Z`, { faults: 1 }));
    const index = indexOf(at('14:19:00'), at('14:21:00'), minutes);
    const [first, second] = [at('14:20:00'), at('14:20:04')];
    add(index, PAGE, [
      entry(0, first, {
        bytes: 4000,
        events: [event(1, first + 500), event(2, first + 600, { level: 'info' })],
      }),
      entry(1, second, {
        to_ms: second + 2000,
        events: [event(3, second + 1, { state: 'off' }), event(4, second + 2, { level: 'caution' })],
        words: [
          { at_ms: second, word: 'online' },
          { at_ms: second + 2000, word: 'silent' },
        ],
      }),
      entry(2, at('14:20:50'), {
        frames: 0,
        to_ms: at('14:20:50'),
        words: [{ at_ms: at('14:20:50'), word: 'offline' }],
      }),
    ]);
    const { movement, marks, words } = index.timeline!;
    expect(movement).toEqual([
      { fromMs: at('14:19:00'), toMs: at('14:20:00'), bytesPerS: 1000 },
      { fromMs: first, toMs: second, bytesPerS: 1000 },
      { fromMs: second, toMs: second + 2000, bytesPerS: 4000 },
    ]);
    expect(marks).toEqual([
      { atMs: at('14:19:00'), level: 'fault', source: '', text: '', exact: false },
      { atMs: first + 500, level: 'fault', source: 'RKN', text: 'bigError', exact: true },
      { atMs: second + 2, level: 'caution', source: 'RKN', text: 'bigError', exact: true },
    ]);
    expect(words).toEqual([
      { fromMs: second + 2000, toMs: at('14:20:50'), word: 'silent' },
      { fromMs: at('14:20:50'), toMs: at('14:21:00'), word: 'offline' },
    ]);
  });

  it('goes on with minutes behind what is known of a page', () => {
    const index = indexOf(at('14:20:00'), at('14:20:04'), [minute('2026-11-22T14:20Z', { bytes: 8000 })]);
    add(index, PAGE, [entry(0, at('14:20:00'))]);
    index.setSummary(readSummary(summary(at('14:20:00'), at('14:20:20'))));
    expect(index.timeline!.movement).toEqual([
      { fromMs: at('14:20:00'), toMs: at('14:20:04'), bytesPerS: 2000 },
      { fromMs: at('14:20:04'), toMs: at('14:20:20'), bytesPerS: 2000 },
    ]);
  });

  it('shows who was offline when nothing more came as offline until something came', () => {
    const index = indexOf(at('14:20:00'), at('14:26:00'), [
      minute('2026-11-22T14:20Z', { word: 'offline' }),
      minute('2026-11-22T14:25Z'),
    ]);
    expect(index.timeline!.words).toEqual([
      { fromMs: at('14:20:00'), toMs: at('14:25:00'), word: 'offline' },
    ]);
    expect(index.timeline!.movement[1]!.fromMs).toBe(at('14:25:00'));
  });

  it('shows who came back as online, though the take of before ends a moment later', () => {
    const index = indexOf(at('14:20:00'), at('14:20:30'));
    const back = at('14:20:20');
    const words = (...said: string[]) =>
      said.map((word) => ({ at_ms: back + (said[0] === 'silent' ? 0 : 1), word }));
    add(index, PAGE, [
      entry(0, at('14:20:00'), { words: [{ at_ms: at('14:20:04'), word: 'offline' }] }),
      entry(1, back + 1, { to_ms: back + 1, frames: 0, words: words('offline', 'silent') }),
      entry(0, back, { take: '00000000000000aa', words: words('silent', 'online') }),
    ]);
    expect(index.timeline!.words).toEqual([{ fromMs: at('14:20:04'), toMs: back + 1, word: 'offline' }]);
  });

  it('loses what left the window', () => {
    const index = indexOf(at('14:20:00'), at('14:20:12'), [minute('2026-11-22T14:20Z')]);
    add(index, PAGE, [entry(0, at('14:20:00')), entry(1, at('14:20:04')), entry(2, at('14:20:08'))]);
    index.setSummary(readSummary(summary(at('14:20:04'), at('14:50:06'))));
    expect(index.timeline!.fromMs, 'the segment at 14:20:04 is cut').toBe(at('14:20:08'));
    expect(index.segmentsIn({ fromMs: 0, toMs: at('15:00:00') }).map((ref) => ref.index)).toEqual([2]);
    expect(index.timeline!.movement[0]!.fromMs).toBe(at('14:20:08'));
    add(index, at('14:40:00'), [entry(9, at('14:40:00'))]);
    index.setSummary(readSummary(summary(at('14:20:09'), at('14:50:09'))));
    expect(index.timeline!.fromMs, 'in between is unknown').toBe(at('14:20:09'));
    index.setSummary(readSummary(summary(at('14:31:00'), at('15:01:00'))));
    expect(index.pagesMs).toEqual([at('14:40:00')]);
  });

  it('is a new one after each change, and the same without', () => {
    const index = indexOf(at('14:20:00'), at('14:20:08'));
    add(index, PAGE, [entry(0, at('14:20:00'))]);
    const before = index.timeline;
    expect(add(index, PAGE, [])).toBe(0);
    expect(index.timeline).toBe(before);
    expect(add(index, PAGE, [entry(0, at('14:20:00')), entry(1, at('14:20:04'))])).toBe(1);
    expect(index.timeline).not.toBe(before);
  });

  it('forgets everything where the clock was set back, or another view is shown', () => {
    const index = indexOf(at('14:20:00'), at('14:20:08'), [minute('2026-11-22T14:20Z')]);
    add(index, PAGE, [entry(0, at('14:20:00'))]);
    expect(index.setSummary(readSummary(summary(at('14:20:00'), at('14:20:04')))), 'an older answer').toBe(
      false,
    );
    expect(index.toMs).toBe(at('14:20:08'));
    expect(index.setSummary(readSummary(summary(at('13:20:00'), at('13:20:08'))))).toBe(true);
    expect([index.toMs, index.pagesMs, index.timeline!.movement]).toEqual([at('13:20:08'), [], []]);
    expect(index.setSummary(readSummary(summary(at('13:20:00'), at('13:20:08'), { view: 'team' })))).toBe(
      true,
    );
  });
});

describe('the segments of a span', () => {
  it('are those that have a part in it, by beginning, then take', () => {
    const index = indexOf(at('14:19:00'), at('14:21:00'));
    add(index, PAGE, [
      entry(7, at('14:20:04'), { take: 'ff00000000000000' }),
      entry(8, at('14:20:04')),
      entry(9, at('14:20:08'), { to_ms: at('14:30:05') }),
    ]);
    add(index, PAGE - 600_000, [entry(6, at('14:19:58'))]);
    const indexes = (from: string, to: string) =>
      index.segmentsIn({ fromMs: at(from), toMs: at(to) }).map((ref) => ref.index);
    expect(indexes('14:19:00', '14:30:00')).toEqual([6, 8, 7, 9]);
    expect(indexes('14:20:01', '14:20:01')).toEqual([6]);
    expect(indexes('14:20:05.5', '14:20:05.5')).toEqual([8, 7]);
    expect(indexes('14:30:04', '14:30:04')).toEqual([9]);
    expect(indexes('14:20:03', '14:20:03')).toEqual([]);
  });
});

describe('the pages to fetch', () => {
  it('are those of which there is anything', () => {
    const index = indexOf(at('14:05:00'), at('14:31:00'), [
      minute('2026-11-22T14:05Z'),
      minute('2026-11-22T14:20Z'),
    ]);
    expect(index.listPages({ fromMs: 0, toMs: Number.POSITIVE_INFINITY })).toEqual([
      at('14:30:00'),
      at('14:20:00'),
      at('14:00:00'),
    ]);
    expect(index.listPages({ fromMs: at('14:22:00'), toMs: at('14:23:00') })).toEqual([at('14:20:00')]);
    expect(index.listPages({ fromMs: Number.NaN, toMs: Number.NaN })).toEqual([]);
  });

  it('are closed ten seconds after their end, and not known before', () => {
    const index = indexOf(at('14:20:00'), at('14:30:04'));
    const page = readPage({ segments: [entry(0, at('14:29:58'))], more: false }, PAGE);
    index.addPage(PAGE, page, 400, index.findKnownMs(PAGE, at('14:30:09')));
    expect([
      index.isClosed(PAGE),
      index.knows(PAGE, at('14:29:00')),
      index.knows(PAGE, at('14:31:00')),
    ]).toEqual([false, true, false]);
    index.addPage(PAGE, page, 400, index.findKnownMs(PAGE, at('14:30:10')));
    expect([index.isClosed(PAGE), index.knows(PAGE, at('14:31:00'))]).toEqual([true, true]);
  });

  it('are closed as well when nothing comes any more, which makes nothing newer', () => {
    const index = indexOf(at('14:20:00'), at('14:20:04'));
    index.addPage(PAGE, readPage({ segments: [] }, PAGE), 100, index.findKnownMs(PAGE, at('14:31:00')));
    expect([index.isClosed(PAGE), index.toMs]).toEqual([true, at('14:20:04')]);
  });

  it('are not known where there is more', () => {
    const index = indexOf(at('14:20:00'), at('14:40:00'));
    add(index, PAGE, [entry(0, at('14:20:00'))], true);
    expect(index.knows(PAGE, at('14:21:00'))).toBe(false);
    expect(index.getLast(PAGE)?.index).toBe(0);
  });

  it('are bounded, those that were used last being kept', () => {
    const index = indexOf(at('14:00:00'), at('14:31:00'));
    const page = (pageMs: number, bytes: number) =>
      index.addPage(pageMs, readPage({ segments: [entry(0, pageMs)] }, pageMs), bytes, pageMs + 600_000);
    page(at('14:00:00'), 10_000_000);
    page(at('14:10:00'), 10_000_000);
    index.knows(at('14:00:00'), at('14:01:00'));
    page(at('14:20:00'), 10_000_000);
    expect(index.pagesMs).toEqual([at('14:00:00'), at('14:20:00')]);
  });
});

describe('minutes', () => {
  it('are asked for again when a minute has passed, and once after their day has', () => {
    const index = indexOf(at('23:50:00'), at('23:59:30'), [minute('2026-11-22T23:59Z')]);
    const next = (toMs: number) => {
      index.setSummary(readSummary(summary(at('23:50:00'), toMs)));
      return index.listDaysToFetch(null);
    };
    expect(next(at('23:59:59'))).toEqual([]);
    expect(next(at('23:59:59') + 3000)).toEqual([DAY + 86_400_000, DAY]);
    index.setDay(DAY + 86_400_000, [], index.toMs);
    index.setDay(DAY, [], index.toMs);
    expect(next(at('23:59:59') + 70_000), 'it was asked for within 10 s of its end').toEqual([
      DAY + 86_400_000,
      DAY,
    ]);
    index.setDay(DAY, [], index.toMs);
    expect(next(at('23:59:59') + 300_000)).toEqual([DAY + 86_400_000]);
  });
});

describe('what is not as documented', () => {
  const good = entry(0, PAGE);
  const cases: [string, unknown, RegExp][] = [
    ['no object', 7, /^page 2026-11-22T14:20Z: no object$/],
    ['no list', { segments: {} }, /^page 2026-11-22T14:20Z: segments: no list$/],
    ['a million', { segments: new Array(1e6).fill(good) }, /1000000 entries, 5000 allowed/],
    ['outside the page', { segments: [entry(0, PAGE + 600_000)] }, /segments\[0\]: from_ms: no number from/],
    ['a time of 1e20', { segments: [{ ...good, to_ms: 1e20 }] }, /to_ms/],
    ['an end before the beginning', { segments: [{ ...good, to_ms: PAGE - 1 }] }, /to_ms/],
    ['a negative count', { segments: [good, { ...good, bytes: -1 }] }, /segments\[1\]: bytes/],
    ['half an index', { segments: [{ ...good, index: 0.5 }] }, /index: no whole number/],
    ['NaN as JSON has it', { segments: [{ ...good, frames: null }] }, /frames/],
    ['another address', { segments: [{ ...good, take: '../../x' }] }, /take: not as documented/],
    ['a hash of 1 MB', { segments: [{ ...good, sha256: 'a'.repeat(1e6) }] }, /sha256: not as documented/],
    [
      'a word of 1 MB',
      { segments: [{ ...good, words: [{ at_ms: PAGE, word: 'x'.repeat(1e6) }] }] },
      /words\[0\]: word/,
    ],
    [
      'a text of 1 MB',
      { segments: [{ ...good, events: [event(1, PAGE, { text: 'x'.repeat(1e6) })] }] },
      /events\[0\]: more/,
    ],
  ];

  it.each(cases)('is refused in one line that names the place: %s', (_, page, says) => {
    const read = () => readPage(page, PAGE);
    expect(read).toThrow(damaged(says));
    expect(() => read()).toThrow(/^.{1,200}$/);
  });

  it('is refused of days and summaries', () => {
    const day = (minutes: unknown) => () => readDay({ minutes }, DAY);
    expect(day([minute('2026-11-23T00:00Z')])).toThrow(damaged(/^day 2026-11-22: minutes\[0\]: minute/));
    expect(day([minute('2026-11-22T99:99Z')])).toThrow(damaged(/minute/));
    expect(day(new Array(1441).fill(minute('2026-11-22T14:00Z')))).toThrow(damaged(/1440 allowed/));
    const past = (more: Readonly<Record<string, unknown>>) => () =>
      readSummary(summary(PAGE, PAGE + 1000, more));
    expect(past({ from_ms: -1 })).toThrow(damaged(/^past: from_ms/));
    expect(past({ to_ms: PAGE - 1 })).toThrow(damaged(/to_ms/));
    expect(past({ past_ms: '30' })).toThrow(damaged(/past_ms/));
    expect(past({ view: 'a/../b' })).toThrow(damaged(/view/));
    expect(past({ days: ['2026-99-99'] })).toThrow(damaged(/days\[0\]/));
    expect(past({ days: new Array(5000).fill('2026-11-22') })).toThrow(damaged(/4000 allowed/));
    expect(past({ past_ms: 0 })()).toBeNull();
    expect(past({ newest: null, from_ms: null, to_ms: null })()).toBeNull();
  });

  it('is passed over in events, of which a newer relay may know more', () => {
    const events = [event(1, PAGE, { level: 'rumour' }), event(2, PAGE)];
    expect(readPage({ segments: [{ ...good, events }] }, PAGE).segments[0]!.events).toMatchObject([
      { n: 2, atMs: PAGE },
    ]);
  });

  it('is refused where ten minutes have more segments than can be', () => {
    const index = indexOf(PAGE, PAGE + 4000);
    const part = (from: number) => Array.from({ length: 4000 }, (_, i) => entry(from + i, PAGE));
    add(index, PAGE, part(0), true);
    expect(() => add(index, PAGE, part(4000), true)).toThrow(damaged(/more than 5000 segments/));
  });

  it('ends: a window of a hundred years has an end', () => {
    const index = new PastIndex();
    const days = Array.from({ length: 4000 }, (_, i) =>
      new Date(i * 86_400_000 + DAY).toISOString().slice(0, 10),
    );
    const to = DAY + 4000 * 86_400_000;
    index.setSummary(readSummary(summary(DAY, to, { days, past_ms: 2 ** 47 })));
    expect(index.listDaysToFetch({ fromMs: 0, toMs: 1e300 })).toHaveLength(16);
    expect(index.listDaysToFetch(null), 'none of its own accord').toEqual([]);
    expect(index.listPages({ fromMs: 0, toMs: 1e300 })).toHaveLength(576_001);
  });
});
