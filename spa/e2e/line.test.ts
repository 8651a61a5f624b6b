import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { holds, renderedFrames } from './robot_page.ts';
import { REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const URDF = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle/robot.urdf');
/** Maximum draw calls for one robot (meshes, a skeleton or a ghost, and its shadow), and for everything shared, including all
 *  signs. */
const CALLS_PER_ROBOT = 5;
const CALLS_AROUND = 7;

describe('robots side by side', () => {
  it('without a body take their place as a card of numbers', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, { pos: { RKN: 0.9 }, wave: { pos: { LKN: [0.4, 0.5] } } }, { robot: 'bare' });
    stage.stack.fedEdge(relay, { pos: { RKN: 0.9, LKN: 0.9 } }, { robot: 'whole', urdf: URDF });
    const page = await stage.open(`${relay.url}/r/bare+whole+nobody`);
    const text = (robot: string) =>
      page.evaluate<string>(`document.querySelector('[data-testid="numbers-${robot}"]')?.textContent ?? ''`);
    await until('its numbers', async () => /RKN pos.0\.900 rad/.test(await text('bare')));
    expect(await text('bare')).toContain('It sent no model');
    await until('one that is not there says so', async () => (await text('nobody')).includes('OFFLINE'));
    await until(
      'the other has its body',
      holds(page, `document.querySelector('[data-testid="line-whole"]')?.style.visibility === 'visible'`),
    );
    expect(await text('whole')).toBe('');
    await page.screenshot('row-without-a-body.png');
  });

  it.skipIf(!FULL)('are chosen from the list, move in one scene, and each has its own chip', async () => {
    const relay = await stage.stack.relay();
    stage.stack.edge(relay, { robot: 'one' });
    const { source } = stage.stack.fedEdge(
      relay,
      { pos: { RKN: 0.9, LKN: 0.9 }, wave: { pos: { RSP: [0.5, 0.5] } } },
      { robot: 'two', urdf: URDF },
    );
    stage.stack.edge(relay, { robot: 'three' });
    const page = await stage.open(`${relay.url}/#/`, { viewport: { width: 900, height: 600 } });
    for (const robot of ['one', 'two', 'three']) {
      await until(
        `${robot} is on air`,
        async () => (await page.findByTestId(`robot-${robot}`).count()) === 1,
      );
    }
    await page.findByRole('button', 'View side by side').click();
    for (const robot of ['one', 'two', 'three']) await page.findByTestId(`robot-${robot}`).click();
    await page.findByRole('link', 'Show 3 side by side').click();
    expect(await page.evaluate<string>('location.hash')).toBe('#/r/one+two+three');

    const chip = (robot: string) =>
      page.evaluate<string>(
        `document.querySelector('[data-testid="line-${robot}"] [data-testid=liveness]')?.dataset.state ?? ''`,
      );
    const at = (robot: string) =>
      page.evaluate<number>(`(() => {
        const label = document.querySelector('[data-testid="line-${robot}"]');
        return label?.style.visibility === 'visible' ? label.getBoundingClientRect().x : -1;
      })()`);
    for (const robot of ['one', 'two', 'three']) {
      await until(`${robot} is LIVE`, async () => (await chip(robot)) === 'LIVE');
      await until(`${robot} has a body`, async () => (await at(robot)) >= 0);
    }
    await until(
      'three bodies with shells',
      async () => (await page.evaluate<number>('window.posecast.scene.triangles')) > 3 * 5000,
    );
    const [one, two, three] = [await at('one'), await at('two'), await at('three')];
    expect(one).toBeLessThan(two);
    expect(two).toBeLessThan(three);
    const wrenches = (i: number) =>
      page.evaluate<number>(
        `window.posecast.scene.signsOf(window.posecast.scene.robots[${i}]).wrenches.length`,
      );
    await until('signs of those that have some', async () => (await wrenches(0)) + (await wrenches(2)) === 8);
    expect(await wrenches(1), 'no sensors').toBe(0);
    expect(await page.findByTestId('level').visible(), 'several robots have no one lean').toBe(false);
    const calls = await page.evaluate<number>('window.posecast.scene.drawCalls');
    console.info(`${calls} draw calls for three robots`);
    expect(calls).toBeLessThanOrEqual(3 * CALLS_PER_ROBOT + CALLS_AROUND);

    source.signal('SIGSTOP');
    await until('one of them is STALE', async () => (await chip('two')) === 'STALE');
    await until('it alone', async () => (await chip('one')) === 'LIVE' && (await chip('three')) === 'LIVE');
    const before = await renderedFrames(page);
    await until('the others go on', async () => (await renderedFrames(page)) > before + 3);
    await page.screenshot('line-laptop.png');
    await page.viewport({ width: 390, height: 844 });
    const inside = (robot: string) =>
      page.evaluate<boolean>(`(() => {
        const { left, right } = document.querySelector('[data-testid="line-${robot}"]').getBoundingClientRect();
        return left >= 0 && right <= innerWidth;
      })()`);
    await until('all of them on a phone', async () => (await inside('one')) && (await inside('three')));
    await page.screenshot('line-phone.png');
  });
});
