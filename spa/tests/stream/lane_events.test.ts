import type { EventMessage } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import type { LaneAnswer } from '../../src/stream/lane/answers.ts';
import { LookBack, MissedEvents } from '../../src/stream/lane/missed_events.ts';
import { Occurrences } from '../../src/twin/alarms/occurrences.ts';
import { type LaneRelay, UNIX_MS } from '../rigs/lane_relay.ts';
import { expectOnce, LaneViewer, watch } from '../rigs/lane_viewer.ts';

const PAGE_MS = 600_000;

/** The page has received each event in order and once, up to the displayed moment. */
function expectWhole(relay: LaneRelay, viewer: LaneViewer): void {
  const shownMs = viewer.nowMs - viewer.behindAt(viewer.nowMs);
  const all = relay.events.filter(({ atMs }) => atMs < shownMs - 500).map(({ n }) => n);
  const told = viewer.events.map(({ n }) => n);
  expectOnce(viewer);
  expect(told.slice(0, all.length)).toEqual(all);
  expect(viewer.twin.events.map(({ n }) => n)).toEqual(told.slice(-100));
}

/** A fault that comes and goes, once every `everyMs`. */
function comesAndGoes(everyMs: number, untilMs: number) {
  return Array.from({ length: Math.floor(untilMs / everyMs) }, (_, i) => [
    { atMs: (i + 0.3) * everyMs, source: 'RKN', state: 'on' as const },
    { atMs: (i + 0.4) * everyMs, source: 'RKN', state: 'off' as const },
  ]).flat();
}

describe('who joins the lane', () => {
  it('is told the events of before, as by a socket, though none is open, and asks for one page', () => {
    const { relay, viewer } = watch({ faults: comesAndGoes(5000, 45_000) }, 60_000);
    viewer.run(63_000);
    expect(viewer.events.length).toBe(18);
    expectWhole(relay, viewer);
    expect(viewer.looks.length).toBeLessThanOrEqual(2);
    expect(viewer.looks[0]!.path).toMatch(/^\/public\/\d{4}-\d\d-\d\dT\d\d:\d0Z$/);
    const occurrences = new Occurrences();
    for (const { source, state, at } of viewer.twin.events)
      if (state === 'on') occurrences.addEvent(source, 1000 * at!, UNIX_MS + 63_000);
    expect(occurrences.times('RKN', UNIX_MS + 63_000)).toBe(9);
  });

  it('is shown the first picture no later', () => {
    const faults = comesAndGoes(5000, 45_000);
    const [early, late] = [true, false].map((hasIndex) => watch({ faults }, 60_000, { hasIndex }).viewer);
    for (const viewer of [early!, late!]) viewer.run(64_000);
    expect(early!.openMs).toBe(late!.openMs);
    expect(early!.looks[0]!.atMs).toBe(early!.openMs);
    expect(early!.requests.length).toBe(late!.requests.length);
  });

  it('asks for nothing where there were no events', () => {
    const { viewer } = watch({}, 40_000);
    viewer.run(80_000);
    expect(viewer.looks).toEqual([]);
  });

  it('is told the ten minutes before, too, and no more than a socket tells', () => {
    const intoPageMs = UNIX_MS % PAGE_MS;
    const joinsMs = PAGE_MS - intoPageMs + 60_000;
    const { relay, viewer } = watch({ lastsMs: joinsMs + 20_000, eventEveryMs: 2000 }, joinsMs);
    viewer.run(joinsMs + 5000);
    expect(viewer.looks.map(({ path }) => path.slice(-6))).toEqual(['14:30Z', '14:20Z']);
    const told = viewer.events.map(({ n }) => n);
    expect(told.length).toBeGreaterThanOrEqual(100);
    expect(told).toEqual(told.map((_, i) => told[0]! + i));
    const newest = relay.events.filter(({ atMs }) => atMs < joinsMs - 8000).at(-1)!;
    expect(told).toContain(newest.n);
    viewer.run(joinsMs + 15_000);
    expect(viewer.looks.length).toBe(2);
  });

  it('is told what is newer in its turn, where the index does not come', () => {
    const faults = comesAndGoes(5000, 85_000);
    const { relay, viewer } = watch({ faults }, 42_000, { hasIndex: false });
    viewer.run(80_000);
    const waits = viewer.looks.slice(1).map(({ atMs }, i) => atMs - viewer.looks[i]!.atMs);
    expect(waits.length, 'not given up at once').toBeGreaterThan(2);
    waits.forEach((ms, i) => {
      expect(ms, 'ever more seldom').toBeGreaterThanOrEqual(1000 * 2 ** i);
    });
    expect(viewer.twin.hasAllEvents, 'so nobody says that there were no faults').toBe(false);
    const told = viewer.events.map(({ n }) => n);
    expectOnce(viewer);
    expect(told).toEqual(
      relay.events.filter(({ n }) => n >= told[0]! && n <= told.at(-1)!).map(({ n }) => n),
    );
  });

  it.each([
    ['refused once', [{ status: 503 }], 15_000],
    ['refused three times', [{ status: 429 }, { status: 502 }, { status: 503 }], 30_000],
    ['late by 3 s', [{ lateMs: 3000 }, { lateMs: 3000 }], 15_000],
    ['late by 6 s', [{ lateMs: 6000 }, { lateMs: 6000 }], 22_000],
    ['late by 10 s', [{ lateMs: 10_000 }, { lateMs: 10_000 }], 30_000],
    ['lost once', [{ lateMs: 40_000 }], 45_000],
  ] as const)('is told all of them, each once, though the index is %s', (_, index, withinMs) => {
    const joinsMs = PAGE_MS - (UNIX_MS % PAGE_MS) + 8000; // so that two pages are needed
    const faults = comesAndGoes(20_000, joinsMs + 60_000);
    const { relay, viewer } = watch({ lastsMs: joinsMs + 90_000, faults }, joinsMs, { index });
    viewer.run(viewer.nowMs + 500);
    for (; Number.isNaN(viewer.openMs); ) viewer.run(viewer.nowMs + 50);
    expect(viewer.twin.hasAllEvents, 'at first it is not known').toBe(false);
    viewer.run(joinsMs + withinMs);
    expect(viewer.twin.hasAllEvents).toBe(true);
    const shownMs = viewer.nowMs - viewer.behindAt(viewer.nowMs);
    const all = relay.events.filter(({ atMs }) => atMs < shownMs - 500).map(({ n }) => n);
    const told = viewer.twin.events.map(({ n }) => n);
    expect(all.length).toBeGreaterThan(50);
    expect(told.slice(0, all.length)).toEqual(all);
    expect(told).toEqual(told.map((_, i) => i + 1));
    const occurrences = new Occurrences();
    const nowMs = UNIX_MS + shownMs;
    const rises = relay.events.filter(({ n, atMs }) => n % 2 === 1 && atMs < shownMs - 500);
    // the page receives the newest first
    for (const late of [false, true])
      for (const { n, source, state, at } of viewer.twin.events)
        if (state === 'on' && n <= all.length && (late || n > all.length - 6))
          occurrences.addEvent(source, 1000 * at!, nowMs);
    expect(occurrences.times('RKN', nowMs)).toBe(Math.min(30, rises.length));
    expect(occurrences.newestMs('RKN')).toBe(UNIX_MS + rises.at(-1)!.atMs);
  });

  it('hears of the index that its lane had not found, by the next lane', () => {
    const back = new LookBack(() => 0.5);
    back.begin({ fromMs: UNIX_MS, eventN: 9, toldN: 0 }, 0);
    expect(back.ask(0)).toBe('2026-11-22T14:20Z');
    back.take(100, null);
    back.resume(5000);
    expect([back.ask(4999), back.ask(5000)]).toEqual([null, '2026-11-22T14:20Z']);
    back.begin({ fromMs: UNIX_MS + PAGE_MS, eventN: 19, toldN: 14 }, 20_000);
    expect(back.ask(20_000)).toBe('2026-11-22T14:30Z');
    expect(back.letGo()?.toldN, 'those of before as well').toBe(0);
  });

  it('gives up after some minutes', () => {
    const back = new LookBack(() => 0.999);
    back.begin({ fromMs: UNIX_MS, eventN: 9, toldN: 0 }, 0);
    let asked = 0;
    let lastMs = 0;
    for (let nowMs = 0; nowMs < 3_600_000; nowMs += 250) {
      if (back.ask(nowMs) === null) continue;
      asked++;
      lastMs = nowMs;
      back.take(nowMs + 100, null);
    }
    expect(asked).toBe(9);
    expect(lastMs).toBeGreaterThan(120_000);
    expect(lastMs).toBeLessThan(600_000);
  });

  it('from a socket is told what came between, and nothing twice', () => {
    const { relay } = watch({ faults: comesAndGoes(5000, 85_000) }, 0);
    const events = relay.events.map(({ text }) => JSON.parse(text) as EventMessage);
    const before = { frame: null, event: { n: 3, at: events[2]!.at }, faults: [events[2]!] };
    const viewer = new LaneViewer(relay, { wayMs: () => 50 }, 60_000, () => 0.5, before);
    viewer.run(70_000);
    const told = viewer.events.map(({ n }) => n);
    expect(told).toEqual(told.map((_, i) => 4 + i));
    expect(told.length).toBeGreaterThan(15);
  });
});

describe('a page that missed parts', () => {
  it('is told the fault that came and went meanwhile, with its own times', () => {
    const faults = [
      { atMs: 5000, source: 'LKN', state: 'on' },
      { atMs: 38_000, source: 'RKN', state: 'on' },
      { atMs: 39_000, source: 'RKN', state: 'off' },
      { atMs: 41_000, source: 'LKN', state: 'off' },
    ] as const;
    const { relay, viewer } = watch({ faults }, 22_000);
    viewer.run(35_000);
    expect(viewer.openFaults).toEqual(['LKN']);
    viewer.run(64_000, true);
    viewer.run(85_000);
    expect(viewer.openFaults).toEqual([]);
    expectWhole(relay, viewer);
    expect(viewer.events.map(({ n }) => n)).toEqual([1, 2, 3, 4]);
    expect(viewer.twin.events.map(({ at }) => Math.round(1000 * at!) - UNIX_MS)).toEqual(
      faults.map(({ atMs }) => atMs),
    );
    expect(viewer.looks.length).toBeLessThanOrEqual(2);
  });

  it('because its network was gone is told them, too', () => {
    const { relay, viewer } = watch({ faults: comesAndGoes(4000, 85_000) }, 22_000, {
      cuts: [{ fromMs: 33_000, toMs: 54_000 }],
    });
    viewer.run(54_000);
    expect(viewer.ends).toMatchObject([{ code: 1006 }]);
    viewer.reopen(55_000);
    viewer.run(88_000);
    expectWhole(relay, viewer);
    expect(viewer.looks.length).toBeLessThanOrEqual(4);
  });

  it('goes on at a relay that counts anew, with what that has told', () => {
    const { viewer } = watch({ faults: comesAndGoes(4000, 85_000), replacedMs: 40_000 }, 22_000);
    viewer.run(88_000);
    expectOnce(viewer);
  });
});

describe('the index of ten minutes', () => {
  const MISSING = { fromMs: UNIX_MS, eventN: 9, toldN: 4 };
  const told = (n: number, agoMs: number) => ({
    ...{ type: 'event', n, t: 1, at: (UNIX_MS - agoMs) / 1000, at_ms: UNIX_MS - agoMs },
    ...{ level: 'fault', source: 'RKN', text: 'jam', state: n % 2 ? 'on' : 'off' },
  });
  const answer = (doc: unknown): LaneAnswer => ({
    ...{ status: 200, isJson: true, retryMs: null, dateMs: null },
    bytes: new TextEncoder().encode(JSON.stringify(doc)),
  });
  const numbers = (missed: MissedEvents) => missed.listWith([]).map(({ n }) => n);

  it('may be mixed of takes, hold what is newer, known, or of another count', () => {
    const missed = new MissedEvents(MISSING);
    expect(missed.page).toBe('2026-11-22T14:20Z');
    missed.add(
      answer({
        segments: [
          { events: [told(6, 800), told(5, 900)] },
          { events: [told(600, 5000), told(9, 300), told(10, -100), told(4, 1000)] },
          { events: [told(6, 800), told(7, 700), told(8, 500)] },
        ],
      }),
    );
    expect(numbers(missed)).toEqual([5, 6, 7, 8, 9]);
    expect(missed.page).toBeNull();
  });

  it.each([
    null,
    [],
    'x',
    {},
    { segments: {} },
    { segments: [null, 7, { events: 'x' }, { events: [null, {}, { at_ms: 'x' }, [told(5, 1)]] }] },
    { segments: [{ events: [{ ...told(9, 1), text: 'x'.repeat(6000) }] }] },
  ])('of a stranger is passed over (%j)', (doc) => {
    const missed = new MissedEvents(MISSING);
    missed.add(answer(doc));
    expect(numbers(missed)).toEqual([]);
    expect(missed.page).toBe('2026-11-22T14:10Z');
    missed.add(answer(doc));
    expect(missed.page).toBeNull();
  });

  it('that is refused is not asked for again', () => {
    const missed = new MissedEvents(MISSING);
    missed.add({ ...answer({}), status: 404 });
    expect(missed.page).toBeNull();
  });
});
