import { expect, it } from 'vitest';
import type { Page, Point } from './driver/page.ts';
import { until } from './driver/until.ts';
import { holds, KEEP_SAVED, newestSaved, savedCount, shownSeq } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const WALKS = {
  cur: { RKN: 1, LKN: 1 },
  ref: { RKN: 0.5, LKN: 0 },
  ftf: { 'RF.fz': 300 },
  wave: { pos: { RKN: [0.4, 0.3], LKN: [0.2, 0.3] }, ftf: { 'RF.fz': [200, 0.5] } },
};

const middleOf = (page: Page, selector: string) =>
  until(selector, () =>
    page.evaluate<Point | null>(`(() => {
      const box = document.querySelector(${JSON.stringify(selector)})?.getBoundingClientRect();
      return box === undefined || box.width === 0 ? null : { x: box.left + box.width / 2, y: box.top + box.height / 2 };
    })()`),
  );
const clickOn = async (page: Page, selector: string) => page.click(await middleOf(page, selector));
const traces = (page: Page) =>
  page.evaluate<[name: string, value: string][]>(
    `[...document.querySelectorAll('[data-testid=trace]')].map((entry) =>
      [entry.querySelector('.plot-name').textContent, entry.querySelector('.c-num').textContent])`,
  );
const named = async (page: Page) => (await traces(page)).map(([name]) => name);

async function opened(): Promise<Page> {
  const relay = await stage.stack.relay();
  stage.stack.fedEdge(relay, WALKS, { profile: 'demo' });
  const page = await stage.open(`${relay.url}/#/r/demo`, {
    preload: KEEP_SAVED,
    viewport: { width: 1280, height: 800 },
  });
  await until('numbers', async () => (await shownSeq(page)) !== null);
  return page;
}

it.skipIf(!FULL)('a cell dragged onto their tab becomes a plot', async (context) => {
  stage.needs(context, 'drops');
  const page = await opened();
  await until(
    'its row on top',
    holds(
      page,
      `(() => {
      document.querySelector('.table-room').scrollTop = 0;
      const rows = [...document.querySelectorAll('.joints tbody tr')].slice(0, 3);
      return rows.some((row) => row.dataset.label === 'RKN');
    })()`,
    ),
  );
  const plotted = async () => (await named(page)).join() === 'RKN cur';
  await until('the plot', async () => {
    const from = await middleOf(page, 'td[data-field="cur"][data-label="RKN"]');
    await page.drag(from, await middleOf(page, '#tab-Plots')); // nothing, before its code has loaded
    return until('it', plotted, 3000).catch(() => false);
  });
});

it.skipIf(!FULL)(
  'any value goes into a plot by a tap, is paused, read off, and saved as a table',
  async () => {
    const page = await opened();
    await page.findByRole('tab', 'Sensors').click();
    await clickOn(page, 'td[data-field="ftf"][data-label="RF.fz"]');
    await page.findByRole('tab', 'Joints').click();
    await page.findByRole('button', /^RKN$/).click();
    await page.findByTestId('plot-pos').click();
    await page.findByTestId('plot-error').click();
    const all = ['right foot Fz', 'RKN pos', 'RKN error'];
    await page.findByRole('tab', /^Plots/).click();
    await until('all of them', async () => (await named(page)).length === all.length);
    expect((await named(page)).toSorted()).toEqual(all.toSorted());
    const pictures = await page.evaluate<number>('document.querySelectorAll(".panel .plot canvas").length');
    expect(pictures, 'one for each unit').toBe(2);

    const position = async () => (await traces(page)).find(([name]) => name === 'RKN pos')?.[1];
    const first = await until('a number', position);
    await until('it moves', async () => (await position()) !== first);
    await page.screenshot('plots-laptop.png');

    await page.findByTestId('plot-pause').click();
    await until('paused', async () => (await page.findByTestId('plots').attribute('data-paused')) === 'true');
    const seq = (await shownSeq(page)) ?? 0;
    const held = await traces(page);
    await until('frames go on', async () => ((await shownSeq(page)) ?? 0) > seq + 15);
    expect(await traces(page)).toEqual(held);

    const over = await page.evaluate<Point>(`(() => {
    const { right, top, height } = document.querySelector('.panel .plot .u-over').getBoundingClientRect();
    return { x: right - 4, y: top + height / 2 };
  })()`);
    await page.click(over);
    await until(
      'when it was',
      holds(page, '/ago$/.test(document.querySelector(".panel .plot-time").textContent)'),
    );

    await page.findByTestId('plot-csv').click();
    await until('a table', async () => (await savedCount(page)) > 0);
    const csv = new TextDecoder().decode((await newestSaved(page)).bytes);
    const [head = '', ...rows] = csv.trim().split('\r\n');
    for (const title of ['"time"', '"RKN error [rad]"', '"RKN pos [rad]"', '"right foot Fz [N]"'])
      expect(head.split(',')).toContain(title);
    expect(rows.length).toBeGreaterThan(5);
    for (const row of rows) expect(row).toMatch(/^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z(,-?[\d.e-]*)+$/);

    await page.findByTestId('plot-pause').click();
    await until(
      'on again',
      async () => (await position()) !== held.find(([name]) => name === 'RKN pos')?.[1],
    );

    await page.viewport({ width: 390, height: 844 });
    await page.findByRole('button', 'Expand the numbers').click();
    await until('room', holds(page, 'document.querySelector(".panel .plot .u-over")?.clientWidth < 360'));
    await page.screenshot('plots-phone.png');
  },
  240_000,
);
