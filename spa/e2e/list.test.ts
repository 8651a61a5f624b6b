import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { is, SWINGING } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** The robots below a heading, from top to bottom. */
const names = (page: Page, list: string) =>
  page.evaluate<string[]>(
    `[...document.querySelectorAll('[data-testid=${list}] .card-name')].map((name) => name.textContent)`,
  );
const path = (page: Page) =>
  page.evaluate<string>('window.location.pathname + window.location.hash.split("?")[0]');

it('a robot that has left stands no more under "On air"; nobody watching is not counted', async () => {
  const relay = await stage.stack.relay();
  const page = await stage.open(`${relay.url}/`);
  await until('commands with the port that it listens on', async () =>
    (await page.evaluate<string>("document.querySelector('.empty')?.textContent ?? ''")).includes(
      `--relay ${relay.zenoh}`,
    ),
  );
  stage.stack.fedEdge(relay, SWINGING, { robot: 'here' });
  const leaves = stage.stack.fedEdge(relay, SWINGING, { robot: 'leaves' });
  await until('both', async () => (await names(page, 'robots')).length === 2);
  await leaves.edge.stop();
  await until('it is below', async () => (await names(page, 'gone-robots')).join() === 'leaves');
  expect(await names(page, 'robots')).toEqual(['here']);
  expect(await page.evaluate<string>("document.querySelector('.list').textContent")).not.toMatch(/0 viewers/);
});

it('robots of one name show their ids as well', async () => {
  const relay = await stage.stack.relay();
  for (const robot of ['left', 'right']) stage.stack.fedEdge(relay, SWINGING, { robot, profile: 'demo' });
  stage.stack.fedEdge(relay, SWINGING, { robot: 'other' });
  const page = await stage.open(`${relay.url}/`);
  await until('all', async () => (await names(page, 'robots')).length === 3);
  const ids = "[...document.querySelectorAll('.card-id')].map((id) => id.textContent)";
  await until('their ids', async () => (await page.evaluate<string[]>(ids)).join() === 'left,right');
});

it('an address without # leads to its robot, and a mistyped one to a sentence and the list', async () => {
  const relay = await stage.stack.relay();
  stage.stack.fedEdge(relay, SWINGING, { robot: 'demo' });
  const page = await stage.newPage();
  page.forgive(/404/); // the browser itself logs this about the page
  await page.open(`${relay.url}/r/demo`);
  await until('LIVE', is(page, 'LIVE'));
  expect(await path(page)).toBe('/r/demo#/r/demo');
  await page.open(`${relay.url}/robots/demo`);
  await until('said so', async () =>
    (await page.evaluate<string>("document.querySelector('.broken')?.textContent ?? ''")).includes(
      '/robots/demo',
    ),
  );
  await page.findByRole('link', 'All robots').click();
  await until('the list', async () => (await names(page, 'robots')).join() === 'demo');
  expect(await path(page)).toBe('/#/');
});
