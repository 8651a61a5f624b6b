import { strToU8, zipSync } from 'fflate';
import { describe, it } from 'vitest';
import type { Page } from '../driver/page.ts';
import { until } from '../driver/until.ts';
import { holds, liveness, tapped, there } from '../robot_page.ts';
import { demoAt } from '../sign_words.ts';
import { setStage } from '../stage.ts';
import {
  around,
  cut,
  dressed,
  LAPTOP,
  type Part,
  PHONE,
  sharpPage,
  takeLive,
  WRITES,
  whole,
  write,
} from './picture.ts';
import { PosedDemo } from './posed_demo.ts';

const stage = setStage({ paints: true });

const JAMMED_S = 42;
const SHOWN_HEIGHT = 640;
const CHIP = '[data-testid="liveness"]';

const is = (page: Page, word: string) => until(word, async () => (await liveness(page)) === word, 60_000);

describe.runIf(WRITES)('pictures of the page', () => {
  it('the demo robot on a laptop and on a phone', async () => {
    const relay = await stage.stack.relay();
    const robot = new PosedDemo(stage.stack, relay, demoAt(JAMMED_S));
    const parts: Part[] = [];
    for (const [theme, viewport] of [
      ['light', LAPTOP],
      ['dark', PHONE],
    ] as const) {
      const page = await sharpPage(stage, { theme }, { viewport });
      await page.open(`${relay.url}/#/r/demo`);
      await dressed(page);
      const take = () => whole(stage, page, viewport, SHOWN_HEIGHT / viewport.height);
      parts.push(await takeLive(page, () => robot.stir(), take));
      if (parts.length === 2) await write(page, 'demo', 'across', ...parts);
    }
  }, 300_000);

  it('the four words, and a picture that is old', async () => {
    const relay = await stage.stack.relay();
    const robot = new PosedDemo(stage.stack, relay, demoAt(1));
    const page = await sharpPage(stage, { theme: 'dark' });
    await page.open(`${relay.url}/#/r/demo`);
    await dressed(page);
    const chip = async () => cut(stage, page, await around(page, CHIP, 8));
    const rated = async () => /Hz/.test((await page.findByTestId('liveness').text()) ?? '');
    await until('a rate', rated);
    const words = [await takeLive(page, () => robot.stir(), chip)];
    robot.hold();
    await is(page, 'HOLDING');
    words.push(await chip());
    robot.silence();
    await is(page, 'STALE');
    words.push(await chip());
    await write(page, 'guide-stale', 'down', await whole(stage, page, LAPTOP, 0.75));
    robot.speak();
    await is(page, 'HOLDING');
    await robot.edge.kill();
    await is(page, 'OFFLINE');
    words.push(await chip());
    await write(page, 'guide-words', 'down', ...words);
  }, 300_000);

  it('a fault on a phone, and its plot', async () => {
    const relay = await stage.stack.relay();
    const robot = new PosedDemo(stage.stack, relay, demoAt(24));
    const page = await sharpPage(stage, { theme: 'light' }, { viewport: PHONE });
    await page.open(`${relay.url}/#/r/demo`);
    await dressed(page);
    await robot.play(24, JAMMED_S);
    await page.findByRole('button', /^Right knee is/).click();
    const card = page.findByTestId('joint-card');
    await until('its card', async () => (await card.count()) === 1);
    const phone = await takeLive(
      page,
      () => robot.stir(),
      () => whole(stage, page, PHONE),
    );
    await write(page, 'guide-fault', 'down', phone);

    await page.viewport(LAPTOP);
    for (const field of ['pos', 'ref', 'cur']) await page.findByTestId(`plot-${field}`).click();
    await page.findByRole('tab', /^Plots/).click();
    await until('three traces', holds(page, 'document.querySelectorAll("[data-testid=trace]").length === 3'));
    await robot.play(36, JAMMED_S);
    await page.press('0');
    const laptop = await takeLive(
      page,
      () => robot.stir(),
      () => whole(stage, page, LAPTOP, 0.75),
    );
    await write(page, 'guide-plot', 'down', laptop);
  }, 300_000);

  it('the list', async () => {
    const relay = await stage.stack.relay();
    const named = { demo: JAMMED_S, lab: 28, hall: 18, left: 1 };
    const robots = Object.entries(named).map(
      ([name, second]) => new PosedDemo(stage.stack, relay, demoAt(second), name),
    );
    const page = await sharpPage(stage, { theme: 'light' });
    await page.open(`${relay.url}/#/`);
    const cards = (list: string) =>
      page.evaluate<number>(`document.querySelectorAll('[data-testid=${list}] .card-name').length`);
    await until('all on air', async () => (await cards('robots')) === robots.length, 60_000);
    const pictures = () =>
      page.evaluate<boolean>(
        `[...document.querySelectorAll('[data-testid=thumbnail]')].every((one) => one.complete !== false)`,
      );
    await until('their pictures', pictures, 30_000);
    await write(page, 'list', 'down', await whole(stage, page, LAPTOP, 0.75));
  }, 300_000);

  it('a robot without a model', async () => {
    const relay = await stage.stack.relay();
    const wave = {
      pos: { shoulder: [0.6, 0.11], elbow: [0.8, 0.17, 1], wrist: [0.3, 0.31, 2] },
      cur: { shoulder: [1.4, 0.11], elbow: [0.9, 0.17], wrist: [0.3, 0.31] },
    };
    stage.stack.fedEdge(
      relay,
      { temp: { shoulder: 36, elbow: 33, wrist: 29 }, wave },
      { robot: 'bench-arm' },
    );
    const page = await sharpPage(stage, { theme: 'dark' });
    await page.open(`${relay.url}/#/r/bench-arm`);
    await is(page, 'LIVE');
    const seq = () => page.evaluate<number>('window.posecast.twin.seq');
    await until('twenty seconds of it', async () => (await seq()) > 600, 90_000);
    await write(page, 'no-model', 'down', await whole(stage, page, LAPTOP, 0.75));
  }, 300_000);

  it('the sheet that shares', async () => {
    const relay = await stage.stack.relay();
    new PosedDemo(stage.stack, relay, demoAt(JAMMED_S));
    const page = await sharpPage(stage, { theme: 'light' }, { viewport: PHONE });
    await page.open(`${relay.url}/#/r/demo`);
    await dressed(page);
    const open = async () => (await page.findByTestId('present').count()) === 1;
    await tapped('the sheet', () => page.press('s'), open);
    await write(page, 'share', 'down', await whole(stage, page, PHONE));
  }, 300_000);

  it("a robot from one's own computer", async () => {
    const relay = await stage.stack.relay();
    const page = await sharpPage(stage, { theme: 'light' });
    await page.open(`${relay.url}/#/`);
    await until('the list', there(page, 'choose-zip'));
    const zip = Buffer.from(zipSync({ 'arm/arm.urdf': strToU8(ARM) })).toString('base64');
    await page.evaluate(`(() => {
      const bytes = Uint8Array.from(atob('${zip}'), (c) => c.charCodeAt(0));
      const chosen = new DataTransfer();
      chosen.items.add(new File([bytes], 'arm.zip'));
      const input = document.querySelector('[data-testid=choose-zip]');
      input.files = chosen.files;
      input.dispatchEvent(new Event('change', { bubbles: true }));
    })()`);
    await until('a body', holds(page, 'Object.keys(window.posecast?.scene?.linkPoses() ?? {}).length > 5'));
    await page.evaluate(`[...document.querySelectorAll('.local-slider input')].forEach((slider, i) => {
      const value = String([0.5, 0.6, -1.2, 0.4, 0.02, 0.02][i] ?? 0);
      Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(slider, value);
      slider.dispatchEvent(new Event('input', { bubbles: true }));
    })`);
    await until('it has moved', holds(page, 'window.posecast.scene.resting'));
    await write(page, 'drop', 'down', await whole(stage, page, LAPTOP, 0.75));
  }, 300_000);
});

/** An arm of cylinders, made for this picture. */
const ARM = `<robot name="arm">
  <material name="light"><color rgba="0.9 0.9 0.92 1"/></material>
  <material name="dark"><color rgba="0.16 0.2 0.26 1"/></material>
  <material name="blue"><color rgba="0.1 0.45 0.75 1"/></material>
  ${link('base', cylinder(0.11, 0.08, 0.04, 'dark'))}
  ${link('turret', cylinder(0.08, 0.14, 0.07, 'light'))}
  ${link('upper_arm', cylinder(0.05, 0.34, 0.17, 'light') + across(0.065, 0.15, 'blue'))}
  ${link('forearm', cylinder(0.042, 0.28, 0.14, 'light') + across(0.055, 0.13, 'blue'))}
  ${link('hand', cylinder(0.035, 0.08, 0.06, 'dark') + across(0.045, 0.1, 'blue'))}
  ${link('left_finger', finger())}
  ${link('right_finger', finger())}
  ${joint('waist', 'revolute', 'base', 'turret', '0 0 0.08', '0 0 1', -2.9, 2.9)}
  ${joint('shoulder', 'revolute', 'turret', 'upper_arm', '0 0 0.16', '0 1 0', -1.8, 1.8)}
  ${joint('elbow', 'revolute', 'upper_arm', 'forearm', '0 0 0.34', '0 1 0', -2.4, 2.4)}
  ${joint('wrist', 'revolute', 'forearm', 'hand', '0 0 0.28', '0 1 0', -1.9, 1.9)}
  ${joint('left_grip', 'prismatic', 'hand', 'left_finger', '0 0 0.1', '0 1 0', 0, 0.04)}
  ${joint('right_grip', 'prismatic', 'hand', 'right_finger', '0 0 0.1', '0 -1 0', 0, 0.04)}
</robot>`;

function link(name: string, visuals: string): string {
  return `<link name="${name}">${visuals}</link>`;
}

/** Upright, its middle `z` metres above its link's origin. */
function cylinder(radius: number, length: number, z: number, material: string): string {
  return `<visual><origin xyz="0 0 ${z}"/><geometry><cylinder radius="${radius}" length="${length}"/></geometry><material name="${material}"/></visual>`;
}

/** The axle of a joint at its link's origin. */
function across(radius: number, length: number, material: string): string {
  return `<visual><origin rpy="1.5708 0 0"/><geometry><cylinder radius="${radius}" length="${length}"/></geometry><material name="${material}"/></visual>`;
}

function finger(): string {
  return `<visual><origin xyz="0 0 0.04"/><geometry><box size="0.03 0.015 0.08"/></geometry><material name="light"/></visual>`;
}

function joint(
  name: string,
  type: string,
  parent: string,
  child: string,
  at: string,
  axis: string,
  lower: number,
  upper: number,
): string {
  return `<joint name="${name}" type="${type}"><parent link="${parent}"/><child link="${child}"/><origin xyz="${at}"/><axis xyz="${axis}"/><limit lower="${lower}" upper="${upper}" effort="1" velocity="1"/></joint>`;
}
