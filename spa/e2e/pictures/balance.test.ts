import { describe, it } from 'vitest';
import type { Page } from '../driver/page.ts';
import { until } from '../driver/until.ts';
import { resting } from '../robot_page.ts';
import { demoOver } from '../sign_words.ts';
import { setStage } from '../stage.ts';
import {
  around,
  cut,
  dressed,
  type Part,
  type Rectangle,
  sharpPage,
  takeLive,
  WRITES,
  write,
} from './picture.ts';
import { PosedDemo } from './posed_demo.ts';

const stage = setStage();

/** Large, so that what lies on the floor is seen. */
const SIZE = { width: 2000, height: 1400 };
/** The floor around its feet. */
const FLOOR = { x: 700, y: 960, width: 600, height: 320 };
const SENTENCE = '.stage .balance-line';
const BALANCE = 'window.posecast.scene?.signs.balance';

/** Between two moments of a walk: short beside the filter of the speed. */
const STEP_S = 1 / 30;

/** Moments of the programme that lead up to a second of it. */
function upTo(second: number, lastS: number): number[] {
  const steps = Math.round(lastS / STEP_S);
  return Array.from({ length: steps + 1 }, (_, i) => second - (steps - i) * STEP_S);
}

/** The demo robot after these seconds of its programme, with nothing beside it. */
async function standing(seconds: readonly number[], joint: string | null) {
  const relay = await stage.stack.relay();
  const [first, ...rest] = demoOver(seconds);
  const robot = new PosedDemo(stage.stack, relay, first!);
  const page = await sharpPage(stage, { panelOpen: false, theme: 'light' }, { viewport: SIZE });
  await page.open(`${relay.url}/#/r/demo${joint === null ? '' : `?joint=${joint}`}`);
  await dressed(page);
  await drawn(page, 'balance', `${BALANCE}?.polygon.length > 2`);
  for (const moment of rest) {
    robot.step(moment, STEP_S);
    const reached = moment.pos?.RKN ?? 0;
    await drawn(page, 'a step', `Math.abs(window.posecast.twin.value('pos', 'RKN') - ${reached}) < 0.002`);
    await until('a picture of it', () => resting(page), 20_000);
  }
  return { robot, page };
}

async function drawn(page: Page, what: string, shown: string): Promise<void> {
  await until(what, () => page.evaluate<boolean>(`(${shown}) === true`), 60_000);
}

/** What is drawn about the robot at one second of its programme, from this side. */
async function draw(
  name: string,
  seconds: readonly number[],
  view: '0' | '1' | '2' | '3',
  at: Rectangle,
  {
    scale = 1,
    sentence = false,
    joint = null,
    shows = 'true',
  }: { scale?: number; sentence?: boolean; joint?: string | null; shows?: string } = {},
): Promise<void> {
  const { robot, page } = await standing(seconds, joint);
  await drawn(page, 'the sign', shows);
  await page.press(view);
  const parts = await takeLive(
    page,
    () => robot.stir(),
    async (): Promise<Part[]> => [
      ...(sentence ? [await cut(stage, page, await around(page, SENTENCE, 4))] : []),
      await cut(stage, page, at, scale),
    ],
  );
  await write(page, name, 'down', ...parts);
}

describe.runIf(WRITES)('pictures of the signs of balance', () => {
  it(
    'the ball and its plumb line',
    () => draw('balance-mass', [2], '0', { x: 830, y: 600, width: 340, height: 600 }, { scale: 0.6 }),
    120_000,
  );

  it(
    'what it stands on',
    () => draw('balance-support', [2], '0', { x: 840, y: 1010, width: 320, height: 200 }),
    120_000,
  );

  it(
    'where the floor pushes back',
    () => draw('balance-pressure', [58], '0', { x: 820, y: 1000, width: 320, height: 180 }),
    120_000,
  );

  it(
    'where it would have to step',
    () =>
      draw('balance-capture', upTo(6.6, 0.6), '0', FLOOR, {
        shows: `Math.hypot(${BALANCE}.capturePoint[0] - ${BALANCE}.centreOfMass[0], ${BALANCE}.capturePoint[1] - ${BALANCE}.centreOfMass[1]) > 0.06`,
      }),
    300_000,
  );

  it(
    'how it walked',
    () => draw('balance-footprints', upTo(9, 4), '0', FLOOR, { shows: `${BALANCE}.footprints > 3` }),
    600_000,
  );

  it(
    'how much a joint has left',
    () =>
      draw(
        'balance-limit',
        [58],
        '0',
        { x: 740, y: 700, width: 520, height: 420 },
        {
          ...{ scale: 0.6, joint: 'RKN', shows: `${BALANCE}.joints.length > 0` },
        },
      ),
    120_000,
  );

  it(
    'the margin and its sentence',
    () => draw('balance-margin', [58], '0', { x: 741, y: 1030, width: 498, height: 150 }, { sentence: true }),
    120_000,
  );
});
