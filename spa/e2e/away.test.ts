import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { FaultyLink } from './proxy.ts';
import { is, there } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** A browser with data saving on prefetches nothing. */
const SAVES_DATA = `Object.defineProperty(navigator, 'connection', { value: { saveData: true }, configurable: true })`;

const triangles = (page: Page) => page.evaluate<number>('window.posecast?.scene?.triangles ?? 0');
/** The file of the light view. */
const LIGHT = 'light';
const has = (page: Page, part: string) => page.requested.some((url) => url.includes(`/${part}-`));
/** Switches to the light view, as a slow device does automatically. */
const draw = (page: Page, how: 'light' | '3d') =>
  page.evaluate(`window.location.hash = '#/r/demo?body=${how}'`);

/** A page that watches a robot over a connection that the test can cut, including the page's own files. */
async function watched(preload = ''): Promise<{ page: Page; link: FaultyLink }> {
  const relay = await stage.stack.demo();
  const link = await FaultyLink.open(relay.port);
  const page = await stage.newPage({ preload, viewport: { width: 900, height: 600 } });
  page.forgive(
    /WebSocket|ERR_|not-here|access control|NetworkError|Could not connect|Cross-Origin|Failed to load/i,
  );
  page.forgive(/dynamically imported module|Loading module from|Importing a module script failed/); // the message differs by browser
  await page.open(`${link.url}/#/r/demo`);
  await until('LIVE', is(page, 'LIVE'));
  await until('a body', async () => (await triangles(page)) > 500);
  await page.evaluate('window.same = true');
  return { page, link };
}

it('a body whose code did not come while the relay was away is there when the relay is, by itself', async () => {
  const { page, link } = await watched(SAVES_DATA);
  try {
    expect(has(page, LIGHT), 'nothing was fetched ahead').toBe(false);
    link.cut(true);
    await until('STALE', is(page, 'STALE'));
    await draw(page, 'light');
    await until('says so', there(page, 'no-scene'));
    expect(await page.findByTestId('no-scene').text()).toMatch(/did not load. Trying again.*Try now/);
    await page.findByTestId('try-now').click();
    expect(await triangles(page)).toBe(0);
    link.heal();
    await until('a body again', async () => (await triangles(page)) > 500);
    await until('LIVE', is(page, 'LIVE'));
    expect(has(page, LIGHT)).toBe(true);
    expect(await page.findByTestId('no-scene').count()).toBe(0);
    expect(await page.evaluate<boolean>('window.same')).toBe(true);
  } finally {
    await link.close();
  }
}, 240_000);

it('what may be needed later is here before the relay goes away', async () => {
  const { page, link } = await watched();
  try {
    for (const part of [LIGHT, 'share', 'settings', 'plots', 'body'])
      await until(`${part} fetched ahead`, () => has(page, part));
    link.cut(true);
    await until('STALE', is(page, 'STALE'));
    await draw(page, 'light');
    await until('a body, drawn by hand', async () => (await triangles(page)) > 500);
    await page.findByRole('button', 'Share').click();
    await until('the sheet', async () => (await page.text()).includes('Embed in your own page'));
    expect(await page.findByTestId('not-here').count()).toBe(0);
  } finally {
    await link.close();
  }
}, 240_000);
