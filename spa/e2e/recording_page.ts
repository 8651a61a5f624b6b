/** What the tests of recordings have in common. */

import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { exportPast, type Told } from './exported.ts';
import { liveness, whole } from './robot_page.ts';
import type { Stack } from './stack.ts';
import type { Stage } from './stage.ts';
import { ClockRobot } from './truth.ts';

export const LAPTOP = { width: 1440, height: 900 };
/** From the joint to the relay, on a machine that does much else. */
export const NEAR_MS = 1000;
export const TOLD = {
  title: 'How a robot tells the time',
  author: 'A. Lecturer',
  licence: 'CC BY 4.0',
  notes: [
    [3, 'Both hands move.'],
    [4, 'Watch the left one.'],
    [12, 'Here it is a quarter round.'],
  ],
} as const satisfies Told;

export const testId = (id: string) => `document.querySelector('[data-testid="${id}"]')`;
export const textOf = (page: Page, id: string) => page.evaluate<string>(`${testId(id)}?.textContent ?? ''`);
export const isRecorded = (page: Page) =>
  until('RECORDED, with a body', async () => (await liveness(page)) === 'RECORDED' && whole(page), 60_000);

export interface Shown {
  readonly seq: number;
  readonly momentMs: number | null;
  /** How far the robot's hands are from that moment, ms. */
  readonly offMs: number;
}
export const shown = (page: Page) =>
  page.evaluate<Shown>(`(() => {
    const { twin, scene } = window.posecast;
    const { RKN, LKN } = scene.linkPoses();
    const angle = (matrix) => Math.atan2(matrix[4], matrix[0]);
    const turn = Math.atan2(angle(RKN), angle(LKN)) / (2 * Math.PI);
    const off = Math.abs((twin.moment_ms % 60000) - ((turn + 1) % 1) * 60000);
    return { seq: twin.seq, momentMs: twin.moment_ms, offMs: Math.min(off, 60000 - off) };
  })()`);

/** A robot that tells the time, and an export of its first seconds. */
export async function recorded(stack: Stack, seconds: number, name?: string) {
  const relay = await stack.relay({ past: 'memory:' });
  const robot = new ClockRobot(stack, relay);
  const lecture = await exportPast(stack, relay, seconds, TOLD, name);
  return { relay, robot, lecture };
}

export async function newPage(stage: Stage, viewport = LAPTOP, preload = '') {
  const page = await stage.newPage({ viewport, preload });
  page.forgive(/WebGL/);
  return page;
}
