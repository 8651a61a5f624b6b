import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { CHOSEN, noticedRobot, openNoticed } from './layout/noticed.ts';
import { hasSkin, holds, testId } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const PHONE = { viewport: { width: 390, height: 844 }, touch: true } as const;

/** The drawn body's part of the stage's height, and what lies over its box. */
const measured = (page: Page) =>
  page.evaluate<{ part: number; over: string[] }>(`(() => {
    const { scene } = window.posecast;
    const stage = document.querySelector('.stage').getBoundingClientRect();
    const box = { left: 1e9, top: 1e9, right: 0, bottom: 0 };
    const look = (left, top, right, bottom, stepX, stepY) => {
      for (let x = left; x < right; x += stepX)
        for (let y = top; y < bottom; y += stepY)
          if (scene.pick(x, y) !== null) {
            box.left = Math.min(box.left, x);
            box.right = Math.max(box.right, x);
            box.top = Math.min(box.top, y);
            box.bottom = Math.max(box.bottom, y);
          }
    };
    look(stage.left, stage.top, stage.right, stage.bottom, 12, 12);
    const { left, top, right, bottom } = box;
    look(left, top - 12, right, top, 4, 2);
    look(left, bottom, right, bottom + 12, 4, 2);
    const over = [...document.querySelectorAll('.stage > :not(.canvas, .stage-middle), .top, .sheet, .split-panel, .time-line, .time-row')]
      .map((each) => ({ name: each.className, at: each.getBoundingClientRect() }))
      .filter(({ at }) => at.width > 1 && at.height > 1)
      .filter(({ at }) => at.left < box.right && at.right > box.left && at.top < box.bottom && at.bottom > box.top)
      .map(({ name }) => name);
    return { part: (box.bottom - box.top) / stage.height, over };
  })()`);

it('with all there is to say, the body keeps most of a phone’s stage, and nothing lies over it', async (context) => {
  stage.needs(context, 'touch');
  const robot = await noticedRobot(stage.stack);
  const page = await stage.newPage({ ...PHONE, preload: CHOSEN, media: { motion: 'reduce' } });
  await openNoticed(page, robot);
  expect(await page.evaluate<string>(`document.querySelector('.notices > button').textContent`)).toContain(
    '4 notices',
  );
  for (const [width, height, least] of [
    [390, 844, 0.55],
    [844, 390, 0.45],
  ] as const) {
    await page.viewport({ width, height });
    let last: unknown = null;
    const isSo = async () => {
      const { part, over } = await measured(page);
      last = { part, over };
      return part >= least && over.length === 0;
    };
    await until('body first', isSo).catch(() => expect.fail(`${width} × ${height}: ${JSON.stringify(last)}`));
    await page.screenshot(`phone-${width}.png`);
  }

  await page.viewport({ width: 390, height: 844 });
  const shown = (id: string) => holds(page, `${testId(id)}?.checkVisibility() === true`);
  for (const [button, inside] of [
    ['.notices', 'unread-note'],
    ['.balance-tucked', 'balance-line'],
    ['.stage-legend', 'load-legend'],
  ] as const) {
    await page.evaluate(`document.querySelector('${button} > button').click()`);
    await until(inside, shown(inside));
    await page.press('Escape');
    await until('closed', async () => !(await shown(inside)()));
  }
});

it('a finger that turns the body has it alone; the numbers have three heights, by finger and by keys', async (context) => {
  stage.needs(context, 'touch');
  const relay = await stage.demo();
  const page = await stage.open(`${relay.url}/#/r/demo`, PHONE);
  await until('a body', () => hasSkin(page));
  await until('its buttons', holds(page, `document.querySelector('.stage-tools') !== null`));
  await page.evaluate(`(() => {
    window.turning = [];
    new MutationObserver(() => window.turning.push(document.querySelector('.stage').matches('[data-turning]')))
      .observe(document.querySelector('.stage'), { attributes: true, attributeFilter: ['data-turning'] });
  })()`);
  await until('alone, until it leaves', async () => {
    await page.touch({ from: { x: 195, y: 250 }, to: { x: 275, y: 250 } });
    return page.evaluate<boolean>(`window.turning.includes(true) && window.turning.at(-1) === false`);
  });

  const height = () => page.findByTestId('sheet').attribute('data-height');
  const named = () => page.evaluate<string>(`document.activeElement.getAttribute('aria-label')`);
  expect(await height()).toBe('half');
  await page.evaluate(`document.querySelector('.grip').focus()`);
  expect(await named()).toBe('Numbers: half height');
  for (const [key, expected, name] of [
    ['ArrowUp', 'full', 'Numbers: full height'],
    ['ArrowUp', 'full', 'Numbers: full height'],
    ['End', 'peek', 'Numbers: one line'],
    ['ArrowUp', 'half', 'Numbers: half height'],
    ['Home', 'full', 'Numbers: full height'],
    ['ArrowDown', 'half', 'Numbers: half height'],
    ['ArrowDown', 'peek', 'Numbers: one line'],
  ] as const) {
    await page.press(key);
    await until(`${key}: ${expected}`, async () => (await height()) === expected && (await named()) === name);
  }
  const grip = () =>
    page.evaluate<{ x: number; y: number }>(`(() => {
      const { left, top, width, height } = document.querySelector('.grip').getBoundingClientRect();
      return { x: left + width / 2, y: top + height / 2 };
    })()`);
  // again, where it moved away from under the finger
  await until('dragged to the top', async () => {
    const from = await grip();
    if ((await height()) !== 'full') await page.touch({ from, to: { ...from, y: 90 } });
    return (await height()) === 'full';
  });
});

it('at 400 % zoom the numbers and the time line are apart', async () => {
  const relay = await stage.demo();
  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: { width: 320, height: 256 } });
  await until(
    'tabs and line',
    holds(
      page,
      `document.querySelector('[role=tablist]') !== null && document.querySelector('[role=slider]') !== null`,
    ),
  );
  const apart = `(() => {
    const line = document.querySelector('.time-line').getBoundingClientRect();
    const tabs = document.querySelector('[role=tablist]').getBoundingClientRect();
    const at = document.elementFromPoint(tabs.left + 30, (tabs.top + tabs.bottom) / 2);
    return line.bottom <= innerHeight && (tabs.bottom <= line.top ? at?.closest('[role=tablist]') != null : at?.closest('[role=tablist]') == null);
  })()`;
  for (const height of ['peek', 'half', 'full']) {
    await until(height, async () => (await page.findByTestId('sheet').attribute('data-height')) === height);
    await until(`apart at ${height}`, holds(page, apart));
    if (height !== 'peek')
      await until(
        `the tabs are above the line at ${height}`,
        holds(
          page,
          `document.querySelector('[role=tablist]').getBoundingClientRect().bottom <= document.querySelector('.time-line').getBoundingClientRect().top`,
        ),
      );
    await page.evaluate(`document.querySelector('.grip').click()`);
  }
});

it('a tiny frame keeps the state and the name, and nothing sticks out', async () => {
  const relay = await stage.demo();
  const page = await stage.open(`${relay.url}/embed/demo/?theme=light`, {
    viewport: { width: 200, height: 150 },
  });
  await until('LIVE', holds(page, `${testId('liveness')}?.dataset.state === 'LIVE'`));
  const [wide, name, cut] = await page.evaluate<[number, string, number]>(`(() => {
    const name = document.querySelector('.embed-name');
    return [document.documentElement.scrollWidth, name.textContent, name.scrollWidth - name.clientWidth];
  })()`);
  expect([wide, name, cut]).toEqual([200, 'demo', 0]);
});
