/** For tests: a swinging robot, a network with delays, and a screen that repaints 60 times a second. */

import type { Stamp } from '../../src/twin/playback/arrivals.ts';

const TICK_MS = 1000 / 60;

/** mulberry32: the same numbers for the same seed, each in [0, 1). */
export function seeded(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let mixed = Math.imul(state ^ (state >>> 15), state | 1);
    mixed ^= mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61);
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 2 ** 32;
  };
}

export interface Course {
  readonly seed: number;
  readonly hz: number;
  readonly seconds: number;
  /** Mean of the exponentially distributed part of the transit time, ms. */
  readonly jitterMs: number;
  /** 0…1 */
  readonly loss: number;
  /** ms of the robot's clock per ms of the viewer's. */
  readonly pace?: number;
  /** The robot stands still whenever this returns true (in its own ms), and then sends every half second. */
  readonly still?: (ms: number) => boolean;
  /** The robot's position at its own time, ms. */
  readonly motion?: (ms: number) => number;
}

const BASE_LATENCY_MS = 40;

/** Two superimposed oscillations, rad. */
export function swing(ms: number): number {
  const s = ms / 1000;
  return 0.8 * Math.sin(2 * Math.PI * 0.7 * s) + 0.2 * Math.sin(2 * Math.PI * 1.9 * s + 1);
}

export interface Arrival extends Stamp {
  readonly value: number;
}

/** Frames in the order of arrival; as over TCP, none overtakes another. */
export function arrivals(course: Course): Arrival[] {
  const random = seeded(course.seed);
  const frames: Arrival[] = [];
  const { pace = 1, motion = swing } = course;
  let atMs = 0;
  let seq = 0;
  let heldMs: number | null = null;
  let sentMs = Number.NEGATIVE_INFINITY;
  for (let robotMs = 0; robotMs < course.seconds * 1000; robotMs += 1000 / course.hz) {
    const still = course.still?.(robotMs) === true;
    heldMs = still ? (heldMs ?? robotMs) : null;
    if (still && robotMs > heldMs! && robotMs - sentMs < 500) continue;
    sentMs = robotMs;
    seq += 1;
    if (random() < course.loss) continue;
    const wayMs = BASE_LATENCY_MS - course.jitterMs * Math.log(1 - random());
    atMs = Math.max(atMs, robotMs / pace + wayMs);
    frames.push({ seq, tS: robotMs / 1000, atMs, value: motion(heldMs ?? robotMs) });
  }
  return frames;
}

/** What a screen shows at each repaint. */
export function play(
  frames: readonly Arrival[],
  push: (frame: Arrival) => void,
  sample: (nowMs: number) => number,
): { readonly nowMs: number; readonly value: number }[] {
  const shown: { nowMs: number; value: number }[] = [];
  let next = 0;
  const endMs = frames.at(-1)!.atMs + 500;
  for (let nowMs = frames[0]!.atMs; nowMs < endMs; nowMs += TICK_MS) {
    while (next < frames.length && frames[next]!.atMs <= nowMs) push(frames[next++]!);
    shown.push({ nowMs, value: sample(nowMs) });
  }
  return shown;
}

/** The largest step between two repaints, once the stream has run for two seconds. */
export function worstJump(shown: readonly { nowMs: number; value: number }[]): number {
  const from = shown.findIndex(({ nowMs }) => nowMs - shown[0]!.nowMs > 2000);
  let worst = 0;
  for (let i = from; i < shown.length; i += 1) {
    worst = Math.max(worst, Math.abs(shown[i]!.value - shown[i - 1]!.value));
  }
  return worst;
}

/** The largest step of the true motion in one repaint. */
export function trueJump(seconds: number): number {
  let worst = 0;
  for (let ms = TICK_MS; ms < seconds * 1000; ms += 1) {
    worst = Math.max(worst, Math.abs(swing(ms) - swing(ms - TICK_MS)));
  }
  return worst;
}
