import type { EventMessage } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import type { LaneAnswer } from '../src/stream/lane/answers.ts';
import { MissedEvents } from '../src/stream/lane/missed_events.ts';
import { Occurrences } from '../src/twin/alarms/occurrences.ts';
import { LaneRelay, type LaneStory, UNIX_MS } from './lane_relay.ts';
import { type LaneNetwork, LaneViewer } from './lane_viewer.ts';
import { seeded } from './playout_sim.ts';

const PAGE_MS = 600_000;

function watch(story: Partial<LaneStory>, joinsMs: number, network: Partial<LaneNetwork> = {}) {
  const random = seeded(4);
  const relay = new LaneRelay({ lastsMs: 90_000, keyMs: 4000, ...story });
  const viewer = new LaneViewer(relay, { wayMs: () => 50 + 150 * random(), ...network }, joinsMs, random);
  return { relay, viewer };
}

/** The page has been told each event in order and once, up to the moment that it shows. */
function expectWhole(relay: LaneRelay, viewer: LaneViewer): void {
  const shownMs = viewer.nowMs - viewer.behindAt(viewer.nowMs);
  const all = relay.events.filter(({ atMs }) => atMs < shownMs - 500).map(({ n }) => n);
  const told = viewer.events.map(({ n }) => n);
  expect(told).toEqual([...new Set(told)].sort((a, b) => a - b));
  expect(told.slice(0, all.length)).toEqual(all);
  expect(viewer.twin.events.map(({ n }) => n)).toEqual(told.slice(-100));
}

/** A fault that comes and goes, once in `everyMs`. */
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
    const { relay, viewer } = watch({ faults }, 42_000, {
      hasIndex: false,
    });
    viewer.run(80_000);
    expect(viewer.looks.length).toBe(1);
    const told = viewer.events.map(({ n }) => n);
    expect(told).toEqual([...new Set(told)].sort((a, b) => a - b));
    expect(told).toEqual(
      relay.events.filter(({ n }) => n >= told[0]! && n <= told.at(-1)!).map(({ n }) => n),
    );
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
    const told = viewer.events.map(({ n }) => n);
    expect(told).toEqual([...new Set(told)].sort((a, b) => a - b));
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
    const missed = new MissedEvents(MISSING, 0);
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
    const missed = new MissedEvents(MISSING, 0);
    missed.add(answer(doc));
    expect(numbers(missed)).toEqual([]);
    expect(missed.page).toBe('2026-11-22T14:10Z');
    missed.add(answer(doc));
    expect(missed.page).toBeNull();
  });

  it('that is refused is not asked for again', () => {
    const missed = new MissedEvents(MISSING, 0);
    missed.add({ ...answer({}), status: 404 });
    expect(missed.page).toBeNull();
  });
});
