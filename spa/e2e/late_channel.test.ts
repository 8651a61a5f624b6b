import path from 'node:path';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { body, is, whole } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const URDF = path.join(REPO, 'edge-agent/src/posecast_edge/demo_bundle/robot.urdf');
const ARM = { RKN: [0.4, 0.5] };
const LATE = { LEB: [0.3, 0.5] };

/** Counts, picture by picture, how often the arm's joint or the body was not there after it had been. */
const WATCH = `(() => {
  window.gaps = 0;
  let begun = false;
  const look = () => {
    const { twin, scene } = window.posecast ?? {};
    const isThere = typeof twin?.value('pos', 'RKN') === 'number' && (scene?.triangles ?? 0) > 500;
    begun ||= isThere;
    if (begun && !isThere) window.gaps += 1;
    requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
})()`;

const has = (page: Page, label: string) =>
  page.evaluate<boolean>(`typeof window.posecast?.twin?.value('pos', '${label}') === 'number'`);

it('a joint that comes later is shown without a gap, and the past is as it was before it came', async () => {
  const relay = await stage.stack.relay({ past: 'memory:' });
  const { source } = stage.stack.fedEdge(relay, { wave: { pos: ARM } }, { urdf: URDF });
  const page = await stage.open(`${relay.url}/#/r/demo`, {
    preload: WATCH,
    viewport: { width: 1366, height: 768 },
  });
  await until('a body', () => whole(page));
  await until('LIVE', is(page, 'LIVE'));
  const track = `document.querySelector('[data-testid="track"]')`;
  const rewindable = (s: number) => async () =>
    page.evaluate<boolean>(`${track} !== null && ${track}.ariaValueMax - ${track}.ariaValueMin >= ${s}`);
  await until('some past', rewindable(6));
  const links = Object.keys((await body(page))?.links ?? {});
  expect(await has(page, 'LEB')).toBe(false);

  source.write(JSON.stringify({ wave: { pos: { ...ARM, ...LATE } } }));
  await until('the joint', () => has(page, 'LEB'));
  const wasMs = await page.evaluate<number>('Date.now()');
  await until('a while', async () => (await page.evaluate<number>('Date.now()')) > wasMs + 2000);
  expect(await page.evaluate<number>('window.gaps'), 'pictures without the arm').toBe(0);
  expect(Object.keys((await body(page))?.links ?? {})).toEqual(links);

  const at = await page.evaluate<{ x: number; y: number }>(`(() => {
    const { left, top, width, height } = ${track}.getBoundingClientRect();
    return { x: left + width * 0.2, y: top + height / 2 };
  })()`);
  await page.click(at);
  await until('PAST', is(page, 'PAST'));
  await until('the arm alone', async () => (await has(page, 'RKN')) && !(await has(page, 'LEB')));
  await page.findByTestId('to-live').click();
  await until('both', async () => (await has(page, 'RKN')) && (await has(page, 'LEB')));
});
