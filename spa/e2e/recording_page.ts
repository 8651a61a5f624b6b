/** Shared code for the tests of recordings. */

import { cpSync } from 'node:fs';
import path from 'node:path';
import { afterAll, beforeAll } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { type Exported, exportPast, type Told } from './exported.ts';
import { is, whole } from './robot_page.ts';
import { Stack } from './stack.ts';
import type { Stage } from './stage.ts';
import { ClockRobot } from './truth.ts';

export const LAPTOP = { width: 1440, height: 900 };
/** Time from the joint to the relay, on a busy machine. */
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

export const isRecorded = (page: Page) =>
  until('RECORDED, with a body', async () => (await is(page, 'RECORDED')()) && whole(page));

/** A robot whose pose encodes the time, and an export of its first seconds. */
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

/** One export for all tests in a file, because it takes seconds; its relay has ended. Call once at the top of the file. */
export function setLecture(seconds: number) {
  const stack = new Stack();
  let made: Awaited<ReturnType<typeof recorded>> | null = null;
  const all = () => {
    if (made === null) throw new Error('nothing is exported yet');
    return made;
  };

  beforeAll(async () => {
    made = await recorded(stack, seconds);
    await made.relay.process.kill(); // these processes are no longer needed
  }, 120_000);

  afterAll(() => stack.down());

  return {
    get robot(): ClockRobot {
      return all().robot;
    },
    /** A copy that a test may damage, in a separate folder. */
    copy(ofTest: Stack): Exported {
      const at = path.join(ofTest.folder(), 'lecture');
      cpSync(all().lecture.at, at, { recursive: true });
      return { ...all().lecture, at };
    },
  };
}
