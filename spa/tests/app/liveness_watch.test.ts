import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { LivenessWatch } from '../../src/app/state/liveness_watch.ts';
import { nowMs } from '../../src/stream/clock.ts';
import { STALE_AFTER_MS } from '../../src/twin/liveness.ts';
import { RobotTwin } from '../../src/twin/robot.ts';

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.restoreAllMocks();
  vi.useRealTimers();
});

it('says STALE in the very moment in which the pose gets too old', () => {
  const twin = new RobotTwin('demo', nowMs());
  const watch = new LivenessWatch(
    twin,
    () => {},
    () => {},
  );
  twin.acceptConnection(true, nowMs());
  twin.acceptWatching(true, nowMs());
  vi.advanceTimersByTime(137); // not a whole number of checks
  const shownMs = nowMs();
  twin.acceptStatus({ robot: 'online', ageMs: 20, seq: 7, degraded: false, overShare: false, atMs: shownMs });
  Object.assign(twin.evidence, { freshMs: shownMs, shownMs });
  const said: [string | null, number][] = [];
  watch.onWord(() => watch.word !== said.at(-1)?.[0] && said.push([watch.word, nowMs() - shownMs]));
  for (const atMs of [600, 1200]) {
    vi.advanceTimersByTime(shownMs + atMs - nowMs());
    const ageMs = nowMs() - shownMs;
    twin.acceptStatus({ robot: 'online', ageMs, seq: 7, degraded: false, overShare: false, atMs: nowMs() });
  }
  vi.advanceTimersByTime(shownMs + 2 * STALE_AFTER_MS - nowMs());
  watch.close();
  expect(said.map(([word]) => word)).toEqual(['LIVE', 'STALE']);
  expect(Math.round(said[1]?.[1] ?? Number.NaN)).toBe(STALE_AFTER_MS);
});

it('tells of another cause at once, though the word stays, so that chip and banner name the same one', () => {
  const { twin, watch } = watched();
  const told: string[] = [];
  watch.onWord(() => told.push(`${watch.word}, ${watch.verdict().cause}`));
  vi.advanceTimersByTime(100);
  const status = { ageMs: 600, seq: 7, degraded: false, overShare: false, atMs: nowMs() };
  twin.acceptStatus({ robot: 'silent', ...status });
  vi.advanceTimersByTime(100);
  twin.acceptConnection(false, nowMs());
  expect(told).toEqual(['STALE, robot silent', 'STALE, no connection']);
  watch.close();
});

/** Time passes while the page is blocked. */
function holdUp(ms: number): void {
  vi.setSystemTime(Date.now() + ms);
  const real = performance.now.bind(performance);
  vi.spyOn(performance, 'now').mockImplementation(() => real() + ms);
}

function watched() {
  const twin = new RobotTwin('demo', nowMs());
  let slept = 0;
  const doubts: number[] = [];
  const watch = new LivenessWatch(
    twin,
    () => {
      slept += 1;
    },
    (sinceMs) => doubts.push(sinceMs),
  );
  twin.acceptConnection(true, nowMs());
  twin.acceptWatching(true, nowMs());
  fresh(twin);
  const said: (string | null)[] = [];
  watch.onWord(() => watch.word !== said.at(-1) && said.push(watch.word));
  vi.advanceTimersByTime(200);
  expect(watch.word).toBe('LIVE');
  return { twin, watch, said, doubts, slept: () => slept };
}

function fresh(twin: RobotTwin): void {
  twin.acceptStatus({ robot: 'online', ageMs: 20, seq: 7, degraded: false, overShare: false, atMs: nowMs() });
  Object.assign(twin.evidence, { freshMs: nowMs(), shownMs: nowMs() });
}

it('a page that was held up calls its picture old, and no more, until what has piled up is in', () => {
  const { twin, watch, said, doubts } = watched();
  holdUp(STALE_AFTER_MS + 1);
  vi.advanceTimersByTime(100);
  expect(said).toEqual(['LIVE', 'STALE']);
  const { word, cause, ageMs } = watch.verdict();
  expect([word, cause], 'not that it connects').toEqual(['STALE', 'busy browser']);
  expect(ageMs).toBeGreaterThan(STALE_AFTER_MS);
  fresh(twin);
  vi.advanceTimersByTime(50);
  expect(said).toEqual(['LIVE', 'STALE', 'LIVE']);
  expect(doubts, 'what was under way is not old').toEqual([]);
  watch.close();
});

it('a page that was held up goes on calling old what it called old', () => {
  const { watch, said } = watched();
  vi.advanceTimersByTime(STALE_AFTER_MS);
  holdUp(3000);
  vi.advanceTimersByTime(100);
  expect([said, watch.verdict().word]).toEqual([['LIVE', 'STALE'], 'STALE']);
  watch.close();
});

it('a page that was held up finds its connection lost: its pose has aged meanwhile', () => {
  const { twin, watch } = watched();
  holdUp(30_000);
  twin.acceptConnection(false, nowMs()); // before the next check
  const { word, cause, ageMs } = watch.verdict();
  expect([word, cause]).toEqual(['STALE', 'no connection']);
  expect(ageMs).toBeGreaterThan(30_000);
  watch.close();
});

it('one that was held up for a moment blames nobody for it', () => {
  const { twin, watch, said } = watched();
  holdUp(STALE_AFTER_MS - 200);
  vi.advanceTimersByTime(100);
  fresh(twin);
  vi.advanceTimersByTime(50);
  expect(said).toEqual(['LIVE']);
  watch.close();
});

it('after a sleep that our clock slept through it claims nothing, and has the connection looked after', () => {
  const { watch, said, slept } = watched();
  vi.setSystemTime(Date.now() + 60_000);
  vi.advanceTimersByTime(100);
  expect([said, slept()]).toEqual([['LIVE', 'STALE'], 1]);
  vi.advanceTimersByTime(50);
  expect(said).toEqual(['LIVE', 'STALE']);
  watch.close();
});

it('once it has called a pose old it is not LIVE again by that pose', () => {
  const { twin, watch, said, doubts } = watched();
  const { shownMs } = twin.evidence;
  expect(doubts).toEqual([]);
  vi.advanceTimersByTime(STALE_AFTER_MS);
  expect(said).toEqual(['LIVE', 'STALE']);
  const { otherwiseMs } = twin.evidence;
  expect(otherwiseMs).not.toBeNull();
  expect(doubts).toEqual([otherwiseMs]);
  Object.assign(twin.evidence, { freshMs: nowMs(), shownMs: otherwiseMs }); // a pose from that very moment may be old
  vi.advanceTimersByTime(100);
  fresh(twin);
  Object.assign(twin.evidence, { shownMs });
  vi.advanceTimersByTime(100);
  expect(said).toEqual(['LIVE', 'STALE']);
  fresh(twin);
  vi.advanceTimersByTime(100);
  expect(said).toEqual(['LIVE', 'STALE', 'LIVE']);
  watch.close();
});
