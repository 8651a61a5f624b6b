import { describe, it } from 'vitest';
import type { Page } from '../driver/page.ts';
import { until } from '../driver/until.ts';
import { holds, resting } from '../robot_page.ts';
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

const stage = setStage({ paints: true });

/** Large, so that signs on the floor are visible. */
const SIZE = { width: 2000, height: 1400 };
/** The floor around its feet, and behind them. */
const FLOOR = { x: 830, y: 930, width: 320, height: 190 };
const BEHIND = { x: 560, y: 930, width: 540, height: 250 };
const SENTENCE = '.stage .balance-line';
const BALANCE = 'window.posecast.scene?.signs.balance';

/** A part of the demo's motion, seconds. */
type Walk = readonly [number, number];

/** The demo robot at one second of its motion, without anything else. `query`: of the page's address. */
async function standing(second: number, query = '') {
  const relay = await stage.stack.relay();
  const robot = new PosedDemo(stage.stack, relay, demoAt(second));
  const page = await openAlone(`${relay.url}/#/r/demo${query}`);
  return { robot, page };
}

/** A page that looks back at a walk of the demo robot and steps through it frame by frame until this is shown: values computed
 *  from many poses need all of them, however slowly the machine draws. */
async function walked([fromS, toS]: Walk, shows: string): Promise<Page> {
  const relay = await stage.stack.relay();
  const robot = new PosedDemo(stage.stack, relay, demoAt(fromS));
  await robot.edge.line(/linked to/);
  const fromMs = Date.now();
  await robot.play(fromS, toS);
  const page = await openAlone(`${relay.url}/#/r/demo?t=${new Date(fromMs).toISOString()}`);
  const moment = () => page.evaluate<number>('window.posecast.twin.moment_ms');
  while (!(await page.evaluate<boolean>(shows))) {
    const beforeMs = await moment();
    await page.press('.');
    await until('the next frame', async () => (await moment()) > beforeMs, 20_000);
    await until('a picture of it', () => resting(page), 60_000);
  }
  return page;
}

async function openAlone(url: string): Promise<Page> {
  const alone = { forces: false, level: false, lens: false, panelOpen: false, theme: 'light' };
  const page = await sharpPage(stage, alone, { viewport: SIZE });
  await page.open(url);
  await dressed(page);
  await drawn(page, 'balance', `${BALANCE}?.polygon.length > 2`);
  return page;
}

async function drawn(page: Page, what: string, shown: string): Promise<void> {
  await until(what, holds(page, `(${shown}) === true`), 60_000);
}

/** The signs about the robot at one second of its motion, or after a part of it, from this side. `shows`: what must be drawn. */
async function draw(
  name: string,
  when: number | Walk,
  view: '0' | '1' | '2' | '3',
  at: Rectangle,
  { scale = 1, sentence = false, query = '', shows = 'true' } = {},
): Promise<void> {
  const { robot, page } =
    typeof when === 'number' ? await standing(when, query) : { robot: null, page: await walked(when, shows) };
  await drawn(page, 'the sign', shows);
  await page.press(view);
  const take = async (): Promise<Part[]> => [
    ...(sentence ? [await cut(stage, page, await around(page, SENTENCE, 4))] : []),
    await cut(stage, page, at, scale),
  ];
  if (robot === null) await until('a picture at rest', () => resting(page), 60_000);
  const parts = await (robot === null ? take() : takeLive(page, () => robot.stir(), take));
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
    'where it would have to step',
    () =>
      draw('balance-capture', [6.4, 7.2], '0', FLOOR, {
        shows: `Math.hypot(${BALANCE}.capturePoint?.[0] - ${BALANCE}.centreOfMass[0], ${BALANCE}.capturePoint?.[1] - ${BALANCE}.centreOfMass[1]) > 0.08`,
      }),
    300_000,
  );

  it(
    'how it walked',
    () => draw('balance-footprints', [5.5, 9], '0', BEHIND, { shows: `${BALANCE}.footprints > 3` }),
    600_000,
  );

  it(
    'how much a joint has left',
    () =>
      draw(
        'balance-limit',
        58,
        '2',
        { x: 740, y: 660, width: 520, height: 420 },
        {
          ...{ scale: 0.6, query: '?joint=RKN', shows: `${BALANCE}.joints.length > 0` },
        },
      ),
    120_000,
  );

  it(
    'the margin and its sentence',
    () => draw('balance-margin', 58, '0', { x: 741, y: 1030, width: 498, height: 150 }, { sentence: true }),
    120_000,
  );
});
