import { describe, expect, it } from 'vitest';
import { MOST_DELAY_MS } from '../../src/twin/playback/arrivals.ts';
import type { Layout } from '../../src/twin/playback/playout.ts';
import { MOST_MOVES, Playout } from '../../src/twin/playback/playout.ts';
import {
  type Arrival,
  arrivals,
  type Course,
  play,
  seeded,
  trueJump,
  worstJump,
} from '../rigs/playout_sim.ts';

const ONE: Layout = { size: 1, wraps: new Set(), quats: [] };
const HALL: Omit<Course, 'seed'> = { hz: 10, seconds: 60, jitterMs: 25, loss: 0.01 };

function played(frames: readonly Arrival[], playout = new Playout(ONE), each: () => void = () => {}) {
  return play(
    frames,
    (frame) => playout.push(frame, [frame.value]),
    (nowMs) => {
      playout.sample(nowMs);
      each();
      return playout.shown[0]!;
    },
  );
}

describe('playing a stream between its frames', () => {
  it.each([1, 2, 3, 4, 5, 6, 7, 8])(
    '10 Hz with 25 ms of jitter: no jump over 5 times the true one (seed %i)',
    (seed) => {
      const frames = arrivals({ ...HALL, seed });
      const raw = new Playout(ONE);
      raw.raw = true;
      const truth = trueJump(HALL.seconds);
      const smooth = worstJump(played(frames)) / truth;
      const snapping = worstJump(played(frames, raw)) / truth;
      console.info(`seed ${seed}: ${smooth.toFixed(2)} × the true step, snapping ${snapping.toFixed(2)} ×`);
      expect(smooth).toBeLessThanOrEqual(5);
      expect(snapping).toBeGreaterThan(8); // otherwise the sequence would prove nothing
    },
  );

  it('shows at once what is seconds newer: the stream came behind, and does no longer', () => {
    const playout = new Playout(ONE);
    const BEHIND_MS = 4000;
    for (let i = 0; i < 60; i += 1)
      playout.push({ seq: i, tS: i / 30, atMs: BEHIND_MS + (i * 1000) / 30 }, [i]);
    const atMs = BEHIND_MS + 2000;
    playout.push({ seq: 180, tS: 6, atMs }, [180]);
    playout.sample(atMs + 1);
    expect(playout.shown[0]).toBe(180);
    playout.push({ seq: 181, tS: 181 / 30, atMs: atMs + 1000 / 30 }, [181]);
    playout.sample(atMs + 150);
    expect(playout.shown[0], 'and goes on').toBe(181);
    expect(playout.delayMs).toBeLessThan(100);
  });

  it.each([
    ['30 Hz', { ...HALL, hz: 30 }],
    ['a perfect network', { ...HALL, jitterMs: 0, loss: 0 }],
    ['a bad one', { ...HALL, jitterMs: 80, loss: 0.05 }],
    ['a clock that drifts', { ...HALL, pace: 1.0005, seconds: 300 }],
    ['a simulation at half the pace', { ...HALL, pace: 0.5 }],
    ['a simulation at twice the pace', { ...HALL, pace: 2 }],
  ] as const)('its lateness never grows: %s', (_name, course) => {
    const pace = 'pace' in course ? course.pace : 1;
    // Its value is its own time, so what is shown reveals its age.
    const frames = arrivals({ ...course, seed: 9, motion: (ms) => ms });
    const playout = new Playout(ONE);
    let longest = 0;
    let fullest = 0;
    const shown = played(frames, playout, () => {
      longest = Math.max(longest, playout.delayMs);
      fullest = Math.max(fullest, playout.waiting);
    });
    expect(longest).toBeLessThanOrEqual(MOST_DELAY_MS);
    expect(fullest).toBeLessThanOrEqual(MOST_MOVES);
    const ages: number[] = [];
    let next = 0;
    let before = Number.NEGATIVE_INFINITY;
    let invented = 0;
    let backwards = 0;
    for (const { nowMs, value } of shown) {
      while (next + 1 < frames.length && frames[next + 1]!.atMs <= nowMs) next += 1;
      if (value > frames[next]!.value) invented += 1;
      if (value < before) backwards += 1;
      before = value;
      if (nowMs < frames.at(-1)!.atMs) ages.push(nowMs - value / pace);
    }
    expect({ invented, backwards }).toEqual({ invented: 0, backwards: 0 });
    const most = (list: readonly number[]) => list.reduce((a, b) => Math.max(a, b), 0);
    const late = most(frames.map(({ atMs, value }) => atMs - value / pace));
    const half = Math.floor(ages.length / 2);
    console.info(
      `oldest: ${most(ages.slice(0, half)).toFixed(0)} ms, later ${most(ages.slice(half)).toFixed(0)} ms`,
    );
    expect(most(ages)).toBeLessThanOrEqual(late + MOST_DELAY_MS + (3 * 1000) / course.hz / pace);
    expect(most(ages.slice(half))).toBeLessThanOrEqual(late + MOST_DELAY_MS + 1000 / course.hz / pace);
  });

  it('stands where the robot stands once it stands', () => {
    const still = (ms: number) => ms % 8000 > 4000;
    const frames = arrivals({ ...HALL, seed: 3, still });
    const playout = new Playout(ONE);
    const newest = frames.at(-1)!;
    played(frames, playout);
    expect(playout.sample(newest.atMs + 1000)).toBe(false);
    expect(playout.shown[0]).toBe(newest.value);
  });

  it('a robot that begins to move does not creep there from half a second before', () => {
    const playout = new Playout(ONE);
    const frame = (seq: number, ms: number, value: number) =>
      playout.push({ seq, tS: ms / 1000, atMs: ms + 40 }, [value]);
    let seq = 0;
    for (let ms = 0; ms <= 1000; ms += 100) frame(seq++, ms, ms / 1000);
    for (let ms = 1500; ms <= 4000; ms += 500) frame(seq++, ms, 1);
    frame(seq++, 4300, 1.1);
    // 300 ms have passed at the robot, but it moved within the last of them.
    playout.sample(4340);
    expect(playout.shown[0]).toBe(1);
    playout.sample(4340 + playout.delayMs / 2);
    expect(playout.shown[0]).toBeGreaterThan(1);
    playout.sample(4340 + 160);
    expect(playout.shown[0]).toBe(1.1);
  });
});

describe('its buffer', () => {
  const full = () => {
    const playout = new Playout(ONE);
    for (let i = 0; i < 20; i += 1) playout.push({ seq: i, tS: i / 10, atMs: i * 100 + 40 }, [i]);
    return playout;
  };

  it.each([
    ['time that steps back', { seq: 20, tS: 0.5, atMs: 2040 }],
    ['a run that counts anew', { seq: 0, tS: 30, atMs: 2040 }],
    ['a long silence', { seq: 500, tS: 30, atMs: 30_040 }],
  ])('empties at %s: the newest is shown at once', (_name, stamp) => {
    const playout = full();
    expect(playout.waiting).toBeGreaterThan(0);
    playout.push(stamp, [7]);
    expect(playout.waiting).toBe(0);
    expect(playout.shown[0]).toBe(7);
    expect(playout.sample(stamp.atMs)).toBe(false);
    playout.push({ ...stamp, seq: stamp.seq + 1, tS: stamp.tS + 0.1, atMs: stamp.atMs + 100 }, [8]);
    playout.sample(stamp.atMs + 100);
    expect(playout.shown[0]).toBeLessThan(8);
    playout.sample(stamp.atMs + 500);
    expect(playout.shown[0]).toBe(8);
  });

  it('follows a clock that is set forward by an hour', () => {
    const playout = full();
    for (let i = 20; i < 30; i += 1) playout.push({ seq: i, tS: 3600 + i / 10, atMs: i * 100 + 40 }, [i]);
    playout.sample(29 * 100 + 40 + MOST_DELAY_MS + 100);
    expect(playout.shown[0]).toBe(29);
    expect(playout.delayMs).toBeLessThanOrEqual(MOST_DELAY_MS);
  });

  it('stays bounded whatever comes, also when nobody looks', () => {
    const random = seeded(5);
    const playout = new Playout(ONE);
    let atMs = 0;
    let tS = 0;
    let fullest = 0;
    let longest = 0;
    for (let seq = 0; seq < 5000; seq += 1) {
      atMs += random() < 0.9 ? random() * 3 : random() * 400;
      tS += random() < 0.99 ? random() * 0.02 : -random();
      playout.push({ seq, tS, atMs }, [random()]);
      fullest = Math.max(fullest, playout.waiting);
      longest = Math.max(longest, playout.delayMs);
    }
    expect(fullest).toBeLessThanOrEqual(MOST_MOVES);
    expect(longest).toBeLessThanOrEqual(MOST_DELAY_MS);
    playout.sample(atMs + 1000);
    expect(playout.waiting).toBe(0);
  });

  it('a frame that is told twice changes nothing', () => {
    const playout = full();
    const { waiting } = playout;
    expect(playout.push({ seq: 19, tS: 1.9, atMs: 2500 }, [19])).toBe(false);
    expect(playout.waiting).toBe(waiting);
  });

  it('an unchanged robot has nothing to be drawn', () => {
    const playout = new Playout(ONE);
    playout.push({ seq: 0, tS: 0, atMs: 40 }, [1]);
    for (let i = 1; i < 100; i += 1) {
      expect(playout.push({ seq: i, tS: i / 2, atMs: i * 500 + 40 }, [1])).toBe(false);
      expect(playout.sample(i * 500 + 50)).toBe(false);
    }
  });
});

describe('values that are no readings', () => {
  it('keep what was read last, and what was never read stays unknown', () => {
    const playout = new Playout({ size: 2, wraps: new Set(), quats: [] });
    playout.push({ seq: 0, tS: 0, atMs: 0 }, [1, Number.NaN]);
    expect([...playout.shown]).toEqual([1, Number.NaN]);
    expect(playout.push({ seq: 1, tS: 0.1, atMs: 100 }, [Number.NaN, Number.NaN])).toBe(false);
    playout.push({ seq: 2, tS: 0.2, atMs: 200 }, [Number.POSITIVE_INFINITY, 5]);
    playout.sample(900);
    expect([...playout.shown]).toEqual([1, 5]);
  });
});

describe('raw', () => {
  it('shows each frame when it comes', () => {
    const playout = new Playout(ONE);
    playout.raw = true;
    for (const frame of arrivals({ ...HALL, seed: 1, seconds: 5 })) {
      playout.push(frame, [frame.value]);
      expect(playout.shown[0]).toBe(frame.value);
      expect(playout.sample(frame.atMs + 1)).toBe(false);
      expect(playout.delayMs).toBe(0);
    }
  });
});
