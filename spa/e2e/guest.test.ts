import { readFileSync } from 'node:fs';
import path from 'node:path';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { Host } from './host.ts';
import { holds } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** The line for a page of one's own, as the guide gives it. */
const SNIPPET = /```html\n(<iframe[^`]*?)```/.exec(
  readFileSync(path.join(REPO, 'docs/how-to/watch/share-and-embed.md'), 'utf8'),
)![1]!;

const SIZES = [
  [390, 844],
  [844, 390],
] as const;

/** An article with a robot in it, on another site. The frame tells the article's script when it is live. */
async function article(size: readonly [width: number, height: number], options: string, touch: boolean) {
  const relay = await stage.demo();
  const host = await Host.open(stage.stack.folder());
  const address = `${relay.url}/embed/demo?origin=${host.url}${options}`;
  const words = '<p>What a robot does, and why.</p>'.repeat(60);
  host.instead.set(
    '/index.html',
    `<!doctype html><meta name="viewport" content="width=device-width"><title>An article</title>
    <script>heard = []; addEventListener('message', ({ data }) => heard.push(data.word))</script>
    <body style="margin: 16px">${words.slice(0, 400)}${SNIPPET.replace(/src="[^"]*"/, `src="${address}"`)}${words}`,
  );
  host.instead.set('/favicon.ico', '');
  const [width, height] = size;
  const page = await stage.newPage({ viewport: { width, height }, touch });
  page.allow(relay.host);
  await page.open(`${host.url}/`);
  await page.evaluate(`document.querySelector('iframe').scrollIntoView({ block: 'center' })`);
  await until('LIVE', holds(page, `heard.includes('LIVE')`));
  await until('the meshes', async () => page.requested.some((url) => /\/model\/.*\.glb/.test(url)));
  return { page, host };
}

const scrolled = (page: Page) => page.evaluate<number>('Math.round(scrollY)');

/** The body of a robot in a frame that fills the page: into another site's frame, a driver can't look. */
async function framed(options: string, touch: boolean) {
  const relay = await stage.demo();
  const page = await stage.newPage({ viewport: { width: 640, height: 400 }, touch });
  await page.open(`${relay.url}/embed/demo${options}`);
  const azimuth = () =>
    page.evaluate<number>(`(() => {
      const { position, target } = window.posecast.scene.eye;
      return Math.atan2(position[1] - target[1], position[0] - target[0]);
    })()`);
  const distance = () =>
    page.evaluate<number>(`(() => {
      const { position, target } = window.posecast.scene.eye;
      return Math.hypot(...position.map((value, i) => value - target[i]));
    })()`);
  await until(
    'a body under its controls',
    holds(page, `window.posecast?.scene?.triangles > 500 && document.querySelector('[data-taken]') !== null`),
  );
  return { page, azimuth, distance };
}

it.each(SIZES)('an article scrolls by three swipes over the robot, at %i × %i', async (...size) => {
  const { page, host } = await article(size, '', true);
  try {
    const [width, height] = size;
    const from = { x: width / 2, y: height * 0.8 };
    let before = await scrolled(page);
    for (let swipe = 0; swipe < 3; swipe += 1) {
      await page.evaluate(`document.querySelector('iframe').scrollIntoView({ block: 'center' })`);
      before = await scrolled(page);
      await page.touch({ from, to: { ...from, y: height * 0.3 } });
      await until('scrolled', async () => (await scrolled(page)) > before + height * 0.3);
    }
  } finally {
    await host.close();
  }
});

it('and by the mouse wheel over it', async () => {
  const { page, host } = await article([1440, 900], '', false);
  try {
    const before = await scrolled(page);
    for (let turn = 0; turn < 3; turn += 1) await page.wheel({ x: 720, y: 450 }, 100);
    await until('scrolled', async () => (await scrolled(page)) >= before + 200);
  } finally {
    await host.close();
  }
});

it('one finger turns the robot after a tap, two at once; until another place is pressed', async () => {
  const { page, azimuth } = await framed('', true);
  const at = { x: 320, y: 180 };
  const right = { from: at, to: { x: at.x + 120, y: at.y } };
  const turned = async (from: number) => Math.abs((await azimuth()) - from) > 0.1;

  let before = await azimuth();
  await page.touch(right);
  await until('it says how', holds(page, `document.querySelector('[data-testid=guest-hint]') !== null`));
  expect(await azimuth()).toBeCloseTo(before, 6);

  const other = { x: at.x, y: at.y + 60 };
  await page.touch(right, { from: other, to: { x: other.x + 120, y: other.y } });
  await until('turned by two', () => turned(before));

  await page.touch({ from: at, to: at });
  await until('taken', holds(page, `document.querySelector('[data-taken=true]') !== null`));
  before = await azimuth();
  await page.touch(right);
  await until('turned by one', () => turned(before));

  await page.findByTestId('liveness').click();
  await until('given back', holds(page, `document.querySelector('[data-taken=false]') !== null`));
});

it('the wheel zooms after a click, with Ctrl, and in a frame that has the page to itself', async () => {
  const at = { x: 320, y: 180 };
  const { page, distance } = await framed('', false);
  const before = await distance();
  await page.wheel(at, -120);
  await page.click(at);
  await until('taken', holds(page, `document.querySelector('[data-taken=true]') !== null`));
  expect(await distance(), 'it may move away from a moving robot').toBeGreaterThan(before * 0.95);
  await page.wheel(at, -120);
  await until('nearer', async () => (await distance()) < before * 0.99);

  const relay = await stage.demo();
  await page.open(`${relay.url}/embed/demo?gestures=all`);
  await until('a body', holds(page, `window.posecast?.scene?.triangles > 500`));
  await until('its footer', holds(page, `document.querySelector('.stage-tools') !== null`));
  const whole = await distance();
  await until('nearer at once', async () => {
    await page.wheel(at, -120);
    return (await distance()) < whole * 0.99;
  });
  expect(
    await page.evaluate<string>(
      `getComputedStyle(document.querySelector('[data-testid=scene] canvas')).touchAction`,
    ),
  ).toBe('none');
});
