import type { EventMessage } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { LANE_SCHEMA, LaneRelay, UNIX_MS } from '../rigs/lane_relay.ts';
import { expectFew, expectOnce, KEY_MS, LaneViewer, quantile, watch } from '../rigs/lane_viewer.ts';
import { seeded } from '../rigs/playout_sim.ts';

/** Moments at which the state word counts as correct whatever the truth: around a change, which the page learns at its ticks. */
const SLACK_MS = 400;

/** What the page should say about the displayed moment, with full knowledge. */
function expectHonest(
  relay: LaneRelay,
  viewer: LaneViewer,
  fromMs: number,
  toMs = Number.POSITIVE_INFINITY,
): void {
  for (const { atMs, verdict } of viewer.words) {
    if (atMs < fromMs || atMs > toMs) continue;
    const behindMs = viewer.behindAt(atMs);
    const could = new Set<string>();
    for (let offMs = -SLACK_MS; offMs <= SLACK_MS; offMs += 50) {
      const word = relay.wordAt(atMs - behindMs + offMs);
      could.add(word === 'online' ? 'LIVE' : word === 'silent' ? 'STALE' : 'OFFLINE');
    }
    expect(could, `${atMs}: ${verdict.word} ${verdict.cause}`).toContain(verdict.word);
  }
}

function wordsOf(viewer: LaneViewer, fromMs: number, toMs = Number.POSITIVE_INFINITY): string[] {
  const words: string[] = [];
  for (const { atMs, verdict } of viewer.words) {
    const word = `${verdict.word}${verdict.cause === null ? '' : `: ${verdict.cause}`}`;
    if (atMs >= fromMs && atMs < toMs && words.at(-1) !== word) words.push(word);
  }
  return words;
}

describe('a page in the lane', () => {
  it.each([1, 2, 3, 4, 5, 6])(
    'shows each frame once, a KEY interval and a moment behind, as steadily as live (%i)',
    (seed) => {
      const joinsMs = 20_000 + 7001 * seed;
      const { relay, viewer } = watch({ eventEveryMs: 3000 }, joinsMs, {}, seed);
      viewer.run(88_000);
      expectOnce(viewer);
      const foundMs = viewer.openMs + KEY_MS + 500;
      const found = viewer.shownAfter(foundMs);
      expect(viewer.delay(0.95, foundMs)).toBeLessThanOrEqual(KEY_MS + 700);
      const [first, last] = [found[0]!, found.at(-1)!];
      const expected = relay.frames.filter((f) => f.atMs >= first.acceptedMs && f.atMs <= last.acceptedMs);
      expect(found.length).toBe(expected.length);
      const waits = found.slice(1).map(({ atMs }, i) => atMs - found[i]!.atMs);
      expect(quantile(waits, 0.999)).toBeLessThanOrEqual(120);
      expect(wordsOf(viewer, viewer.openMs)).toEqual(['LIVE']);
      expect(viewer.events.length).toBeGreaterThan(8);
      // reported within a quarter of a second, and never too low by more than an answer's transit time
      for (const { atMs, acceptedMs } of found) {
        const told = viewer.behindAt(atMs);
        expect(Math.abs(told - (atMs - acceptedMs))).toBeLessThan(400);
      }
      // the starting point, the newest part, its schema, and then one request each
      const parts = relay.parts.filter(({ closedMs }) => closedMs > joinsMs && closedMs < 88_000).length;
      expect(viewer.requests.length).toBeLessThanOrEqual(parts + 5);
      expectFew(viewer);
    },
  );

  it('holds a request for about a second', () => {
    const { relay, viewer } = watch({}, 21_300);
    viewer.run(80_000);
    const asked = viewer.requests.filter(({ path }) => /[0-9]$/.test(path)).slice(3);
    for (const { atMs, path } of asked) {
      const part = relay.parts.find(({ take, index }) => path.endsWith(`/${take}/${index}`));
      expect((part?.closedMs ?? atMs) - atMs).toBeLessThan(1100);
    }
  });

  it('says what the robot was: a pause of a minute', () => {
    const { relay, viewer } = watch({ pauses: [{ fromMs: 30_500, toMs: 60_100 }] }, 15_000);
    viewer.run(85_000);
    expectOnce(viewer);
    expectHonest(relay, viewer, 21_000);
    expect(wordsOf(viewer, 21_000)).toEqual(['LIVE', 'STALE: robot silent', 'OFFLINE', 'LIVE']);
    expectFew(viewer);
    expect(viewer.shown.length).toBeGreaterThan(
      relay.frames.filter((f) => f.atMs > 15_000 && f.atMs < 78_000).length - 10,
    );
  });

  it('joins a robot that paused, with its last pose and its age', () => {
    const { relay, viewer } = watch({ pauses: [{ fromMs: 20_500, toMs: 60_100 }] }, 40_000);
    viewer.run(58_000);
    expect(wordsOf(viewer, viewer.openMs + 10)).toEqual(['OFFLINE']);
    expect(viewer.shown.map(({ name }) => name)).toEqual([
      relay.frames.findLast((f) => f.atMs < 20_500)?.name,
    ]);
    viewer.run(85_000);
    expectOnce(viewer);
    expect(wordsOf(viewer, viewer.openMs + 10)).toEqual(['OFFLINE', 'LIVE']);
  });

  it('joins near the place where it should be, if answers tell when they were made', () => {
    for (const joinsMs of [22_000, 23_000, 24_000, 25_000]) {
      const { viewer } = watch({ tellsDate: true }, joinsMs);
      viewer.run(60_000);
      expectOnce(viewer);
      expect(viewer.delay(1)).toBeLessThanOrEqual(KEY_MS + 1700);
      expect(wordsOf(viewer, viewer.openMs)).toEqual(['LIVE']);
    }
  });

  it('is as far behind as it says from the beginning, though a slow device takes long over the first part', () => {
    for (const slowMs of [400, 900]) {
      const ways = [5, 5, 5, slowMs];
      const network = { wayMs: () => ways.shift() ?? 20 };
      const { viewer } = watch({ tellsDate: true }, 22_900, network);
      viewer.run(50_000);
      const [first] = viewer.behinds;
      const shown = viewer.shown[0]!;
      expect(Math.abs(first!.ms! - (shown.atMs - shown.acceptedMs)), `${slowMs} ms`).toBeLessThan(
        slowMs + 600,
      );
      expect(wordsOf(viewer, viewer.openMs)).toEqual(['LIVE']);
    }
  });

  it.each([
    [30_000, KEY_MS],
    [45_000, KEY_MS],
    [20_000, 1000],
  ])(
    'comes to the end of the past where a cache names one of up to %i ms ago, KEYs each %i ms',
    (endKeptMs, keyMs) => {
      for (const joinsMs of [1, 2].map((at) => (2 + at) * endKeptMs - 500)) {
        const { viewer } = watch({ lastsMs: 260_000, keyMs, endKeptMs, eventEveryMs: 3000 }, joinsMs);
        viewer.run(joinsMs + 60_000);
        expectOnce(viewer);
        const afterMs = viewer.openMs + 15_000;
        const later = viewer.shownAfter(afterMs);
        expect(later.length).toBeGreaterThan(40 * 30);
        expect(viewer.delay(0.95, afterMs)).toBeLessThanOrEqual(keyMs + 1000);
        for (const { atMs, acceptedMs } of later)
          expect(Math.abs(viewer.behindAt(atMs) - (atMs - acceptedMs))).toBeLessThan(400);
        expectFew(viewer, 20);
      }
    },
  );

  it('comes back to the end of the past after a sleep, though a cache names an old one', () => {
    const { relay, viewer } = watch({ lastsMs: 200_000, endKeptMs: 70_000, eventEveryMs: 5000 }, 71_000);
    viewer.run(80_000);
    viewer.run(112_000, true);
    viewer.run(138_000);
    expectOnce(viewer);
    expect(viewer.shownAfter(124_000).length).toBeGreaterThan(10 * 30);
    expect(viewer.delay(0.95, 124_000)).toBeLessThanOrEqual(KEY_MS + 1000);
    const told = relay.events.filter(({ atMs }) => atMs > 72_000 && atMs < 130_000).map(({ n }) => n);
    expect(viewer.events.map(({ n }) => n)).toEqual(expect.arrayContaining(told));
    expectFew(viewer, 20);
  });

  it('knows how long a robot has been gone, if answers tell when they were made', () => {
    const { viewer } = watch({ tellsDate: true, pauses: [{ fromMs: 20_500, toMs: 70_000 }] }, 50_000);
    viewer.run(55_000);
    const { verdict, atMs } = viewer.words.at(-1)!;
    expect(verdict.word).toBe('OFFLINE');
    expect(Math.abs((verdict.ageMs ?? 0) - (atMs - 20_500))).toBeLessThan(1500);
    viewer.run(88_000);
    expect(wordsOf(viewer, viewer.openMs + 10)).toEqual(['OFFLINE', 'LIVE']);
    expectOnce(viewer);
  });

  it('follows another run, whose frames are numbered from the beginning again', () => {
    const { relay, viewer } = watch({ restartsMs: [40_700, 41_900, 55_000] }, 22_000);
    viewer.run(85_000);
    expectOnce(viewer);
    expect(new Set(viewer.shown.map(({ name }) => name.split(':')[0]))).toEqual(
      new Set(['1', '2', '3', '4']),
    );
    expect(viewer.delay(0.95, 60_000)).toBeLessThanOrEqual(KEY_MS + 1700);
    expect(relay.frames.length).toBeGreaterThan(0);
    expectFew(viewer);
  });

  it.each([0, 1500, -1500, 3_600_000, -3_600_000])(
    'goes on at another relay, whose clock differs by %i ms',
    (otherClockMs) => {
      const { viewer } = watch({ replacedMs: 40_000, otherClockMs }, 22_000);
      viewer.run(88_000);
      expectOnce(viewer);
      expect(viewer.shownAfter(60_000).length).toBeGreaterThan(25 * 30);
      expect(viewer.delay(0.95, 60_000)).toBeLessThanOrEqual(KEY_MS + 1700);
      expectFew(viewer);
    },
  );

  it('says that it waits when the next part does not come, and goes on by itself', () => {
    const { relay, viewer } = watch({}, 22_000, { cuts: [{ fromMs: 45_200, toMs: 55_000 }] }, 3);
    viewer.run(88_000);
    expectOnce(viewer);
    const words = wordsOf(viewer, 40_000);
    expect(words[1]).toBe('STALE: waiting for the next part');
    expect(words.at(-1)).toBe('LIVE');
    expect(words.filter((word) => /silent|OFFLINE/.test(word))).toEqual([]);
    expectFew(viewer);
    expectHonest(relay, viewer, 70_000);
  });

  it('passes over a damaged part: asks for it once, and goes on with the next', () => {
    const { relay, viewer } = watch({ lastsMs: 89_999 }, 22_000, {}, 3); // its own, for it is changed
    const at = relay.parts.findIndex(({ closedMs }) => closedMs > 45_000);
    const { take, index, bytes, closedMs } = relay.parts[at]!;
    relay.parts[at] = { ...relay.parts[at]!, bytes: bytes.slice(0, -5) };
    viewer.run(88_000);
    expect(viewer.ends).toEqual([]);
    expect(viewer.requests.filter(({ path }) => path === `/public/${take}/${index}`)).toHaveLength(1);
    expectOnce(viewer);
    expect(
      viewer.shown.some(({ acceptedMs }) => acceptedMs > closedMs - KEY_MS && acceptedMs < closedMs - 100),
    ).toBe(false);
    expect(wordsOf(viewer, closedMs + 3 * KEY_MS)).toEqual(['LIVE']);
    expectFew(viewer);
  });

  it('does not ask again and again where it is refused', () => {
    const { viewer } = watch({}, 22_000, { blackouts: [{ fromMs: 40_000, toMs: 43_000 }] }, 3);
    viewer.run(88_000);
    expectOnce(viewer);
    expect(wordsOf(viewer, 60_000)).toEqual(['LIVE']);
    expectFew(viewer);
    const { viewer: other } = watch({}, 22_000, { blackouts: [{ fromMs: 40_000, toMs: 90_000 }] }, 3);
    other.run(88_000);
    expect(other.ends).toMatchObject([{ code: 1006 }]);
    expectFew(other);
  });

  it('jumps to where it should be after the page was frozen, and plays nothing late', () => {
    const { relay, viewer } = watch({ eventEveryMs: 5000 }, 22_000);
    viewer.run(40_000);
    viewer.run(60_000, true);
    viewer.run(88_000);
    expectOnce(viewer);
    expect(viewer.delay(0.95, 68_000)).toBeLessThanOrEqual(KEY_MS + 1000);
    expectHonest(relay, viewer, 68_000);
    expectFew(viewer);
  });

  it('shows nothing on a hidden page, and keeps its word and its events', () => {
    const { viewer } = watch({ eventEveryMs: 3000, pauses: [{ fromMs: 50_000, toMs: 54_000 }] }, 22_000);
    viewer.run(35_000);
    viewer.setVisible(false);
    const before = viewer.shown.length;
    viewer.run(70_000);
    expect(viewer.shown.length).toBe(before);
    expect(wordsOf(viewer, 35_500, 70_000)).toEqual(['LIVE', 'STALE: robot silent', 'LIVE']);
    expect(viewer.events.at(-1)?.atMs).toBeGreaterThan(60_000);
    viewer.setVisible(true);
    viewer.run(70_100);
    expect(viewer.shown.length).toBeGreaterThan(before);
    expect(wordsOf(viewer, 70_050)).toEqual(['LIVE']);
    expectOnce(viewer);
  });

  it('changes its delay gently when a robot sends KEYs more often', () => {
    const { viewer } = watch({ lastsMs: 160_000, laterKeyMs: { atMs: 40_000, keyMs: 1500 } }, 22_000);
    viewer.run(155_000);
    expectOnce(viewer);
    const spans = viewer.shown.slice(1).map((next, i) => {
      const before = viewer.shown[i]!;
      return [next.atMs - before.atMs, next.acceptedMs - before.acceptedMs] as const;
    });
    for (const [pageMs, robotMs] of spans.slice(400)) expect(Math.abs(robotMs - pageMs)).toBeLessThan(60);
    expect(viewer.delay(0.95, 140_000)).toBeLessThanOrEqual(1500 + 700);
  });
});

/** A fault that begins at 30 s and ends at 37.5 s, and another at 40 s that stays. */
const FAULTS = [
  { atMs: 30_000, source: 'RKN', state: 'on' },
  { atMs: 37_500, source: 'RKN', state: 'off' },
  { atMs: 40_000, source: 'LKN', state: 'on' },
] as const;

describe('faults in the lane', () => {
  it('that ended and began while the page slept are settled when it comes back, if no index can be had', () => {
    const { viewer } = watch({ faults: FAULTS }, 16_000, { hasIndex: false });
    viewer.run(37_000);
    expect(viewer.openFaults).toEqual(['RKN']);
    viewer.run(70_000, true);
    viewer.run(88_000);
    expect(viewer.openFaults).toEqual(['LKN']);
    const told = viewer.twin.events.map(({ source, state, at }) => [
      source,
      state,
      Math.round(at! * 1000) - UNIX_MS,
    ]);
    expect(told).toMatchObject([
      ['RKN', 'on', 30_000],
      ['RKN', 'off', expect.any(Number)],
      ['LKN', 'on', 40_000],
    ]);
    expect(told[1]![2]).toBeGreaterThan(40_000);
    expect(new Set(viewer.twin.events.map(({ n }) => n)).size).toBe(3);
  });

  it('are told at once to who joins, and one that a page takes for open ends', () => {
    const { viewer } = watch({ faults: FAULTS }, 60_000);
    viewer.run(63_000);
    expect(viewer.openFaults).toEqual(['LKN']);
    const { relay } = watch({ faults: FAULTS }, 60_000);
    const [rose] = relay.events.map(({ text }) => JSON.parse(text) as EventMessage);
    const before = { frame: null, event: { n: 1, at: rose!.at }, faults: [rose!] };
    const network = { wayMs: () => 50, hasIndex: false };
    const other = new LaneViewer(relay, network, 60_000, () => 0.5, before);
    other.run(63_000);
    expect(other.events.map(({ n }) => Math.floor(n))).toEqual([1, 3]);
    expect(other.openFaults).toEqual(['LKN']);
  });

  it('that a socket has told a moment ago stay open, though the lane still shows what was before', () => {
    const { relay } = watch({ faults: FAULTS }, 41_000);
    const events = relay.events.map(({ text }) => JSON.parse(text) as EventMessage);
    const before = { frame: null, event: { n: 3, at: events[2]!.at }, faults: [events[2]!] };
    const viewer = new LaneViewer(relay, { wayMs: () => 50 }, 41_000, () => 0.5, before);
    viewer.run(70_000);
    expect(viewer.events).toEqual([]);
  });

  it('of a relay that knows of none end with the take of the other', () => {
    const { viewer } = watch({ faults: FAULTS, replacedMs: 55_000, otherForgets: true }, 22_000);
    viewer.run(50_000);
    expect(viewer.openFaults).toEqual(['LKN']);
    viewer.run(85_000);
    expect(viewer.openFaults).toEqual([]);
  });
});

describe('a page that comes from a socket', () => {
  it.each([1, 2, 3, 4])('shows nothing that the socket has shown (%i)', (seed) => {
    const random = seeded(seed);
    const relay = new LaneRelay({ lastsMs: 90_000, keyMs: KEY_MS, eventEveryMs: 2000 });
    const joinsMs = 30_000 + 6000 * random();
    const last = relay.frames.findLast(({ atMs }) => atMs < joinsMs - 200 - 3000 * random())!;
    const event = relay.events.findLast(({ atMs }) => atMs < last.atMs)!;
    const { n, at } = JSON.parse(event.text) as { n: number; at: number };
    const frame = { schemaId: LANE_SCHEMA.id, seq: last.seq, tS: last.tS, atMs: last.atMs + 100 };
    const viewer = new LaneViewer(relay, { wayMs: () => 50 + 150 * random() }, joinsMs, random, {
      frame,
      event: { n, at },
      faults: [],
    });
    viewer.run(60_000);
    expect(Math.min(...viewer.shown.map(({ acceptedMs }) => acceptedMs))).toBeGreaterThan(last.atMs);
    expect(Math.min(...viewer.events.map((each) => each.n))).toBe(n + 1);
    expectOnce(viewer);
    expect(viewer.shown.length).toBeGreaterThan(15 * 30);
  });

  it('shows a run that began meanwhile, though it counts from the beginning', () => {
    const relay = new LaneRelay({ lastsMs: 90_000, keyMs: KEY_MS, restartsMs: [31_000] });
    const random = seeded(7);
    const last = relay.frames.findLast(({ atMs }) => atMs < 30_000)!;
    const frame = { schemaId: LANE_SCHEMA.id, seq: last.seq, tS: last.tS, atMs: last.atMs + 100 };
    const viewer = new LaneViewer(relay, { wayMs: () => 100 }, 34_000, random, {
      frame,
      event: null,
      faults: [],
    });
    viewer.run(60_000);
    expectOnce(viewer);
    expect(viewer.shown[0]?.acceptedMs).toBeLessThan(46_000);
    expect(viewer.shown.every(({ acceptedMs }) => acceptedMs > last.atMs)).toBe(true);
  });
});
