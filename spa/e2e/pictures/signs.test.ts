import { describe, expect, it } from 'vitest';
import type { Page } from '../driver/page.ts';
import { until } from '../driver/until.ts';
import { holds } from '../robot_page.ts';
import { demoAt, signs } from '../sign_words.ts';
import { setStage } from '../stage.ts';
import { cut, dressed, LAPTOP, sharpPage, takeLive, WRITES, whole, write } from './picture.ts';
import { PosedDemo } from './posed_demo.ts';

const stage = setStage({ paints: true });

/** The centre of a laptop's page with the panel closed: the body, and the signs about it. */
const MIDDLE = { x: 320, y: 84, width: 640, height: 650 };
/** The same with the legend beside it. */
const WITH_LEGEND = { ...MIDDLE, width: 960 };
const SIDE = 'document.querySelector("[data-testid=line-page]")';

/** The signs about the robot at one second of its motion, from this side. */
async function draw(
  name: string,
  second: number,
  view: '0' | '1' | '2',
  settings: Record<string, unknown>,
  drawn: (page: Page) => Promise<boolean>,
  at = MIDDLE,
): Promise<void> {
  const relay = await stage.stack.relay();
  const robot = new PosedDemo(stage.stack, relay, demoAt(second));
  const page = await sharpPage(stage, { panelOpen: false, ...settings });
  await page.open(`${relay.url}/#/r/demo`);
  if (settings.body !== 'light') await dressed(page);
  await until('signs', () => drawn(page), 60_000);
  await page.press(view);
  const part = await takeLive(
    page,
    () => robot.stir(),
    () => cut(stage, page, at),
  );
  await write(page, name, 'down', part);
}

describe.runIf(WRITES)('pictures of the signs', () => {
  it(
    'a knee that jammed',
    () =>
      draw(
        'signs-knee',
        42,
        '0',
        { theme: 'dark' },
        async (page) => (await signs(page)).ghostLinks.length > 0,
      ),
    300_000,
  );

  it(
    'the same in the light view',
    () =>
      draw(
        'signs-light',
        42,
        '0',
        { theme: 'light', body: 'light' },
        async (page) => (await signs(page)).ghostLinks.length > 0,
      ),
    300_000,
  );

  it(
    'a hand that pushes too hard',
    () =>
      draw(
        'signs-force',
        29.5,
        '2',
        { theme: 'dark', headingLocked: true },
        async (page) => (await signs(page)).deviations.length > 0,
      ),
    300_000,
  );

  it(
    'heat',
    () =>
      draw(
        'signs-heat',
        29.5,
        '2',
        { theme: 'light', load: 'temp', headingLocked: true },
        async (page) => Object.keys((await signs(page)).loads).length > 10,
        WITH_LEGEND,
      ),
    300_000,
  );

  it(
    'a bow',
    () =>
      draw(
        'signs-lean',
        18.5,
        '0',
        { theme: 'light' },
        async (page) => Math.abs((await signs(page)).level.pitch ?? 0) > 0.1,
      ),
    300_000,
  );

  it('two robots side by side', async () => {
    const relay = await stage.stack.relay();
    const robots = [
      new PosedDemo(stage.stack, relay, demoAt(42), 'left'),
      new PosedDemo(stage.stack, relay, demoAt(29.5), 'right'),
    ];
    const page = await sharpPage(stage, { theme: 'dark' });
    await page.open(`${relay.url}/#/r/left+right`);
    const live = () =>
      page.evaluate<boolean>(
        `[...document.querySelectorAll('[data-testid^=line-] [data-testid=liveness]')].filter((chip) => chip.dataset.state === 'LIVE').length === 2`,
      );
    await until('both bodies', holds(page, '(window.posecast?.scene?.triangles ?? 0) > 20000'), 60_000);
    const part = await until(
      'both live',
      async () => {
        for (const robot of robots) robot.stir();
        await until('LIVE', live, 10_000);
        await until('rest', holds(page, 'window.posecast.scene.resting'), 20_000);
        const taken = await whole(stage, page, LAPTOP, 0.75);
        return (await live()) ? taken : null;
      },
      120_000,
    );
    expect(await page.evaluate<boolean>(`${SIDE} !== null`)).toBe(true);
    await write(page, 'signs-line', 'down', part);
  }, 300_000);
});
