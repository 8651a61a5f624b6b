import { describe, expect, it } from 'vitest';
import { LaneRelay, type LaneStory } from './lane_relay.ts';
import { type LaneNetwork, LaneViewer, quantile, type Shown } from './lane_viewer.ts';
import { seeded } from './playout_sim.ts';

const KEY_MS = 4000;

function watch(story: Partial<LaneStory>, joinsMs: number, seed = 1, network: Partial<LaneNetwork> = {}) {
  const random = seeded(seed);
  const relay = new LaneRelay({ lastsMs: 90_000, keyMs: KEY_MS, ...story });
  const viewer = new LaneViewer(relay, { wayMs: () => 50 + 150 * random(), ...network }, joinsMs, random);
  return { relay, viewer };
}

function expectOnce(shown: readonly Shown[]): void {
  expect(new Set(shown.map(({ name }) => name)).size).toBe(shown.length);
  const accepted = shown.map(({ acceptedMs }) => acceptedMs);
  expect(accepted).toEqual([...accepted].sort((a, b) => a - b));
}

describe('a page in the lane', () => {
  it('shows each frame once, as steadily as live, a KEY interval and a moment behind', () => {
    const { relay, viewer } = watch({ eventEveryMs: 3000 }, 21_300);
    viewer.run(85_000);
    expectOnce(viewer.shown);
    const found = viewer.shown.filter(({ atMs }) => atMs > viewer.openMs + KEY_MS + 1000);
    const behind = found.map(({ atMs, acceptedMs }) => atMs - acceptedMs);
    console.info(
      'behind',
      quantile(behind, 0.05),
      quantile(behind, 0.5),
      quantile(behind, 0.95),
      quantile(behind, 1),
    );
    const [first, last] = [found[0]!, found.at(-1)!];
    const expected = relay.frames.filter((f) => f.atMs >= first.acceptedMs && f.atMs <= last.acceptedMs);
    console.info('frames', found.length, expected.length, 'requests', viewer.requests.length);
    console.info(
      viewer.requests
        .slice(0, 12)
        .map((r) => `${r.atMs.toFixed(0)} ${r.path}`)
        .join('\n'),
    );
    console.info(JSON.stringify(viewer.behinds.slice(0, 10)));
    expect(quantile(behind, 0.95)).toBeLessThanOrEqual(KEY_MS + 700);
    expect(found.length).toBe(expected.length);
    const words = new Set(
      viewer.words.filter(({ atMs }) => atMs > viewer.openMs).map(({ verdict }) => verdict.word),
    );
    expect([...words]).toEqual(['LIVE']);
  });
});
