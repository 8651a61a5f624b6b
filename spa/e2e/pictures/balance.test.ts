import { describe, it } from 'vitest';
import type { Page } from '../driver/page.ts';
import { until } from '../driver/until.ts';
import { demoAt } from '../sign_words.ts';
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
const SENTENCE = '.stage .balance-line';
const BALANCE = 'window.posecast.scene?.signs.balance';

/** The demo robot at a second of its programme, with nothing beside it. */
async function standing(second: number) {
  const relay = await stage.stack.relay();
  const robot = new PosedDemo(stage.stack, relay, demoAt(second));
  const page = await sharpPage(stage, { panelOpen: false, theme: 'light' }, { viewport: SIZE });
  await page.open(`${relay.url}/#/r/demo`);
  await dressed(page);
  await drawn(page, 'balance', `${BALANCE}?.polygon.length > 2`);
  return { robot, page };
}

async function drawn(page: Page, what: string, shown: string): Promise<void> {
  await until(what, () => page.evaluate<boolean>(`(${shown}) === true`), 60_000);
}

/** What is drawn about the robot at one second of its programme, from this side. */
async function draw(
  name: string,
  second: number,
  view: '0' | '1' | '2' | '3',
  at: Rectangle,
  { scale = 1, sentence = false } = {},
): Promise<void> {
  const { robot, page } = await standing(second);
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
    () => draw('balance-mass', 2, '0', { x: 830, y: 600, width: 340, height: 600 }, { scale: 0.6 }),
    120_000,
  );

  it(
    'what it stands on',
    () => draw('balance-support', 2, '0', { x: 840, y: 1010, width: 320, height: 200 }),
    120_000,
  );

  it(
    'where the floor pushes back',
    () => draw('balance-pressure', 58, '0', { x: 820, y: 1000, width: 320, height: 180 }),
    120_000,
  );

  it(
    'the margin and its sentence',
    () => draw('balance-margin', 58, '0', { x: 741, y: 1030, width: 498, height: 150 }, { sentence: true }),
    120_000,
  );
});
