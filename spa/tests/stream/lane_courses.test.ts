import { describe, expect, it } from 'vitest';
import { isClaim } from '../../src/twin/liveness.ts';
import { LaneRelay, type Span } from '../rigs/lane_relay.ts';
import { expectFew, expectOnce, KEY_MS, LaneViewer } from '../rigs/lane_viewer.ts';
import { seeded } from '../rigs/playout_sim.ts';

/** Random scenarios: pauses, new runs, another relay, cuts, refusals, frozen and hidden pages. */

const LASTS_MS = 150_000;
const CALM_MS = 100_000;
/** The page learns of a change at its next tick, and a status is sent twice a second. */
const SLACK_MS = 600;
const COURSES = Number(process.env.POSECAST_LANE_COURSES ?? 12);

interface Course {
  readonly relay: LaneRelay;
  readonly viewer: LaneViewer;
  readonly told: string;
}

function run(seed: number): Course {
  const random = seeded(seed);
  const within = (fromMs: number, toMs: number) => fromMs + (toMs - fromMs) * random();
  const some = <T>(most: number, make: () => T): T[] =>
    Array.from({ length: Math.floor((most + 1) * random()) }, make);
  const span = (mostMs: number) => (): Span => {
    const fromMs = within(20_000, CALM_MS - 30_000);
    return { fromMs, toMs: fromMs + within(200, mostMs) };
  };
  const pauses = some(2, span(20_000));
  const restartsMs = some(2, () => within(20_000, CALM_MS - 30_000)).sort((a, b) => a - b);
  const other =
    random() < 0.3 ? { replacedMs: within(30_000, 60_000), otherClockMs: within(-2000, 2000) } : {};
  const cuts = some(2, span(12_000));
  const blackouts = some(1, span(8000));
  const frozen = some(1, span(15_000));
  const hidden = some(1, span(15_000));
  const joinsMs = within(12_000, 40_000);
  const eventEveryMs = within(1500, 6000);
  const story = { pauses, restartsMs, ...other };
  const told = JSON.stringify({ seed, joinsMs, ...story, cuts, blackouts, frozen, hidden });
  const relay = new LaneRelay({ lastsMs: LASTS_MS, keyMs: KEY_MS, ...story, eventEveryMs });
  const wayMs = () => within(25, 100);
  const viewer = new LaneViewer(relay, { wayMs, cuts, blackouts }, joinsMs, random);
  while (viewer.nowMs < LASTS_MS - 5000) {
    const { nowMs } = viewer;
    const ice = frozen.find(({ fromMs, toMs }) => nowMs >= fromMs && nowMs < toMs);
    if (ice !== undefined) viewer.run(ice.toMs, true);
    viewer.setVisible(!hidden.some(({ fromMs, toMs }) => nowMs >= fromMs && nowMs < toMs));
    viewer.run(nowMs + 500);
    if (viewer.ends.length > 0) viewer.reopen(viewer.nowMs + within(500, 3000)); // as the session does
  }
  return { relay, viewer, told };
}

describe.each(Array.from({ length: COURSES }, (_, i) => i + 1))('course %i', (seed) => {
  const { relay, viewer, told } = run(seed);

  it('shows no frame twice, none older than one before, no event twice', () => {
    expectOnce(viewer, told);
    const newest = relay.events.findLast(({ atMs }) => atMs < LASTS_MS - 16_000)!;
    const { state } = viewer.twin.events.findLast((event) => event.n < newest.n + 1)!;
    expect(newest.text, told).toContain(`"state":"${state}"`);
  });

  it('asks once a second at most, and a few times at once', () => {
    expectFew(viewer, 15, told);
  });

  it('never calls live what was not', () => {
    for (const { atMs, verdict } of viewer.words) {
      if (!isClaim(verdict.word)) continue;
      const newest = viewer.shown.findLast((each) => each.atMs <= atMs);
      const bySight = newest === undefined ? atMs : newest.acceptedMs + atMs - newest.atMs;
      const moments = [atMs - viewer.behindAt(atMs), bySight]; // only a bound is reported if the lane has just started
      const words = moments.flatMap((momentMs) =>
        Array.from({ length: 25 }, (_, i) => relay.wordAt(momentMs + (i - 12) * (SLACK_MS / 12))),
      );
      expect(words, `${told} ${atMs}`).toContain('online');
    }
  });

  it('ends well: live, a KEY interval and a moment behind', () => {
    const calm = viewer.words.filter(({ atMs }) => atMs > CALM_MS + 30_000);
    expect(new Set(calm.map(({ verdict }) => verdict.word)), told).toEqual(new Set(['LIVE']));
    expect(viewer.delay(0.95, CALM_MS + 30_000), told).toBeLessThanOrEqual(KEY_MS + 700);
  });
});
