import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { engineName } from './driver/engines.ts';
import type { Page, Point } from './driver/page.ts';
import { until } from './driver/until.ts';
import { body, drawsNothing, hasSkin, holds, resting, tapped } from './robot_page.ts';
import { REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const MODEL = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle/model');

interface EyePlace {
  readonly position: readonly [number, number, number];
  readonly target: readonly [number, number, number];
}

const demo = stage.share(async (stack) => {
  const relay = await stack.relay();
  stack.builtEdge(relay, { folder: MODEL }, { pos: { RKN: 0 } }, 'demo');
  return relay;
});

const PHONE = { viewport: { width: 390, height: 844 }, touch: true };

/** The page of the demo robot, which stands still. */
async function opened(page: Page): Promise<Page> {
  const relay = await demo();
  await page.open(`${relay.url}/#/r/demo`);
  await until('a body', () => hasSkin(page));
  // the body makes room for its buttons, which load later
  await until('its buttons', holds(page, `document.querySelector('.stage-tools') !== null`));
  await drawsNothing(page, 1);
  return page;
}

const onLaptop = stage.share(async (_, newPage) => opened(await newPage()));
const onPhone = stage.share(async (_, newPage) => opened(await newPage(PHONE)));

/** A page that other tests have used, in its initial view again. */
async function standing(used: () => Promise<Page>): Promise<Page> {
  const page = await used();
  await page.evaluate('document.activeElement?.blur()');
  await page.press('0');
  await still(page);
  return page;
}

const still = (page: Page) => until('the eye rests', () => resting(page));

/** The eye position once everything is at rest. */
async function eye(page: Page): Promise<EyePlace & { distance: number; azimuth: number }> {
  await still(page);
  const place = await page.evaluate<EyePlace>('window.posecast.scene.eye');
  const [x, y, z] = place.position.map((value, i) => value - place.target[i]!);
  return { ...place, distance: Math.hypot(x!, y!, z!), azimuth: Math.atan2(y!, x!) };
}

async function middle(page: Page): Promise<Point> {
  return page.evaluate<Point>(`(() => {
    const { left, top, width, height } = document.querySelector('[data-testid="scene"] canvas').getBoundingClientRect();
    return { x: left + width / 2, y: top + height / 2 };
  })()`);
}

const linkAt = (page: Page, { x, y }: Point) =>
  page.evaluate<string | null>(`window.posecast.scene.pick(${x}, ${y})`);

const apart = (a: readonly number[], b: readonly number[]) =>
  Math.hypot(...a.map((value, i) => value - b[i]!));

/** A point of the picture that hits this link, and one that hits nothing. */
async function places(page: Page): Promise<{ robot: Point; link: string; floor: Point }> {
  const at = await middle(page);
  const robot = { x: at.x, y: at.y - 60 };
  const link = await linkAt(page, robot);
  const floor = { x: at.x - 150, y: at.y + 60 };
  if (link === null || (await linkAt(page, floor)) !== null) throw new Error('the robot stands elsewhere');
  return { robot, link, floor };
}

describe('the camera under fingers', () => {
  it('turns under one finger, moves and comes nearer under two', async (context) => {
    stage.needs(context, 'touch');
    const page = await standing(onPhone);
    const at = await middle(page);
    const before = await eye(page);
    await page.touch({ from: at, to: { x: at.x + 80, y: at.y } });
    await until('a turn', async () => Math.abs((await eye(page)).azimuth - before.azimuth) > 0.2);
    const turned = await eye(page);
    expect(turned.distance).toBeCloseTo(before.distance, 4);
    expect(apart(turned.target, before.target)).toBeLessThan(1e-6);

    const left = { x: at.x - 40, y: at.y };
    const right = { x: at.x + 40, y: at.y };
    await page.touch(
      { from: left, to: { ...left, x: left.x - 60 } },
      { from: right, to: { ...right, x: right.x + 60 } },
    );
    await until('nearer', async () => (await eye(page)).distance < turned.distance * 0.7);
    const near = await eye(page);
    expect(near.azimuth).toBeCloseTo(turned.azimuth, 1);
    await page.touch(
      { from: left, to: { ...left, y: left.y + 60 } },
      { from: right, to: { ...right, y: right.y + 60 } },
    );
    await until('moved', async () => apart((await eye(page)).target, near.target) > 0.05);
    expect((await eye(page)).distance / near.distance).toBeCloseTo(1, 1);
  });

  it('comes close to what is tapped twice, and back when the floor is', async (context) => {
    stage.needs(context, 'touch');
    const page = await standing(onPhone);
    const before = await eye(page);
    const { robot, link, floor } = await places(page);
    await page.doubleTap(robot);
    await until('close', async () => (await eye(page)).distance < before.distance / 2);
    const pose = (await body(page))?.links[link] ?? [];
    expect(apart((await eye(page)).target, [pose[3]!, pose[7]!, pose[11]!])).toBeLessThan(1e-6);
    await page.screenshot(`close-${engineName()}.png`);
    const away = (await linkAt(page, floor)) === null ? floor : { x: 8, y: 60 };
    await page.doubleTap(away);
    await until('back', async () => Math.abs((await eye(page)).distance - before.distance) < 1e-3);
  });
});

describe('the camera under the mouse', () => {
  it('turns with the left button, and comes close by a double click', async () => {
    const page = await standing(onLaptop);
    const before = await eye(page);
    const { robot } = await places(page);
    await page.drag(robot, { x: robot.x + 100, y: robot.y });
    await until('a turn', async () => Math.abs((await eye(page)).azimuth - before.azimuth) > 0.2);
    expect(apart((await eye(page)).target, before.target)).toBeLessThan(1e-6);
    const at = await middle(page);
    const close = async () => (await eye(page)).distance < before.distance / 2;
    await tapped('close', () => page.doubleClick(at), close);
  });

  it.skipIf(!FULL)(
    'moves with the right button, and the wheel comes nearer to what it points at',
    async (context) => {
      stage.needs(context, 'buttons');
      stage.needs(context, 'wheel');
      const page = await standing(onLaptop);
      const before = await eye(page);
      const { robot, link } = await places(page);
      for (let turn = 0; turn < 4; turn++) await page.wheel(robot, -120);
      await until('nearer', async () => (await eye(page)).distance < before.distance * 0.9);
      expect(await linkAt(page, robot), 'what the wheel pointed at').toBe(link);
      const near = await eye(page);
      await page.drag(robot, { x: robot.x + 80, y: robot.y }, 'right');
      await until('moved', async () => apart((await eye(page)).target, near.target) > 0.05);
      expect((await eye(page)).azimuth).toBeCloseTo(near.azimuth, 6);
    },
  );
});

describe('the camera under keys', () => {
  it('turns, moves, comes nearer, and knows its views', async () => {
    const page = await standing(onLaptop);
    const first = await eye(page);
    await page.press('ArrowLeft');
    const turned = await eye(page);
    expect(Math.abs(turned.azimuth - first.azimuth)).toBeCloseTo(Math.PI / 24, 4);
    await page.press('Shift+ArrowUp');
    expect(apart((await eye(page)).target, first.target)).toBeGreaterThan(0.02);
    await page.press('+');
    expect((await eye(page)).distance).toBeCloseTo(turned.distance * 0.85, 4);
    await page.press('1');
    expect((await eye(page)).azimuth).toBeCloseTo(0, 4);
    await page.press('3');
    const { position, target, distance } = await eye(page);
    expect(position[2] - target[2]).toBeGreaterThan(distance * 0.99);
    await page.press('0');
    expect(apart((await eye(page)).position, first.position)).toBeLessThan(1e-3);
    await page.press('c');
    expect((await eye(page)).distance).toBeLessThan(first.distance / 2);
  });

  it('is not the camera while something else has the focus', async () => {
    const page = await standing(onLaptop);
    const before = await eye(page);
    await page.evaluate(`document.querySelector('[role=tab]').focus()`);
    await page.press('ArrowLeft');
    await page.press('1');
    const after = await eye(page);
    expect(apart(after.position, before.position)).toBeLessThan(1e-9);
    expect(apart(after.target, before.target)).toBeLessThan(1e-9);
  });

  it.skipIf(!FULL)('is there at once for who wants less motion', async (context) => {
    stage.needs(context, 'media');
    const page = await opened(await stage.newPage({ media: { motion: 'reduce' } }));
    const azimuth = await page.evaluate<number>(`(() => {
      dispatchEvent(new KeyboardEvent('keydown', { key: '2' }));
      const { position, target } = window.posecast.scene.eye;
      return Math.atan2(position[1] - target[1], position[0] - target[0]);
    })()`);
    expect(azimuth).toBeCloseTo(-Math.PI / 2, 4);
  });
});
