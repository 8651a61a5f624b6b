import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { shownSeq } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** As in an iframe of another site whose storage the browser keeps shut. */
const NO_STORAGE = `for (const name of ['localStorage', 'sessionStorage'])
  Object.defineProperty(window, name, { get() { throw new DOMException('denied', 'SecurityError'); } })`;

const rows = (page: Page) =>
  page.evaluate<string[]>(
    `[...document.querySelectorAll('.joints tbody tr')].filter((row) => !row.hidden).map((row) => row.dataset.label)`,
  );
const text = (page: Page, selector: string) =>
  page.evaluate<string>(`document.querySelector(${JSON.stringify(selector)})?.textContent ?? ''`);
const whole = async (page: Page) => {
  expect(await page.evaluate<boolean>('document.querySelector(".broken") === null')).toBe(true);
  const wide = await page.evaluate<number>('document.documentElement.scrollWidth - window.innerWidth');
  expect(wide, 'nothing sticks out').toBeLessThanOrEqual(0);
};

it('a board that falls silent, another set of joints and names that bite: table, card, plot and filter stand, without storage', async () => {
  const relay = await stage.stack.relay();
  const sample = { pos: { RKN: 0.4, LKN: 0.2, REB: 0.1 }, cur: { RKN: 1.5, LKN: 1, REB: 1 } };
  const first = stage.stack.fedEdge(relay, sample);
  const page = await stage.newPage({ preload: NO_STORAGE, viewport: { width: 1280, height: 800 } });
  await page.open(`${relay.url}/#/r/demo`);
  await until('rows', async () => (await rows(page)).length === 3);
  await page.findByTestId('filter').type('kn');
  await until('filtered', async () => (await rows(page)).toSorted().join() === 'LKN,RKN');
  await page.findByTestId('angle').click();
  await until('degrees', async () => (await text(page, '.joints thead .c-pos')).includes('°'));
  await page.findByRole('button', /^RKN$/).click();
  await page.findByTestId('plot-cur').click();

  // the currents fall silent while positions go on
  first.source.write(JSON.stringify({ pos: { ...sample.pos, LKN: 0.3 } }));
  const cur = 'td[data-field="cur"][data-label="RKN"]';
  await until('it is old', () =>
    page.evaluate<boolean>(`document.querySelector('${cur}').hasAttribute('data-old')`),
  );
  expect(await text(page, cur)).toContain('1.50');
  await until('its age', async () =>
    /^cur \d+(\.\d)? s old/.test(await text(page, 'tr[data-label="RKN"] .c-flags')),
  );
  await until('in the card, too', async () =>
    /last read \d.* ago/.test(await text(page, '[data-testid=joint-card]')),
  );
  await whole(page);

  // it comes back as another robot, whose joints are called whatever one likes
  first.edge.signal('SIGKILL');
  const odd = ['<img src=x onerror="window.bitten=true">', '__proto__', '=1+1', `LKN${'x'.repeat(190)}`];
  const values = (value: number) => Object.fromEntries(odd.map((name) => [name, value]));
  stage.stack.fedEdge(relay, { pos: values(0.5), cur: values(2) });
  await until('the filter holds', async () => (await rows(page)).join() === odd[3], 30_000);
  await until('the card says so', async () =>
    (await text(page, '[data-testid=joint-card]')).includes('This robot has no such joint now.'),
  );
  await page.findByRole('tab', /^Plots/).click();
  await until('the plot says so', async () =>
    (await text(page, '.panel .plot-legend')).includes('not reported now'),
  );
  await page.findByRole('tab', 'Joints').click();
  await page.press('Escape');
  await page.findByTestId('filter').type('');
  await until('all rows', async () => (await rows(page)).length === odd.length);
  for (const name of odd) {
    await page.evaluate(
      `[...document.querySelectorAll('.joints tbody tr')].find((row) => row.dataset.label === ${JSON.stringify(name)}).querySelector('button').click()`,
    );
    await until('its card', async () => (await text(page, '[data-testid=joint-card] h2')) === name);
    await page.findByTestId('plot-pos').click();
  }
  await page.findByRole('tab', /^Plots/).click();
  await until('all traces', () =>
    page.evaluate<boolean>(`document.querySelectorAll('[data-testid=trace]').length === ${odd.length + 1}`),
  );
  const seq = (await shownSeq(page)) ?? 0;
  await until('frames go on', async () => ((await shownSeq(page)) ?? 0) > seq + 3);
  expect(
    await page.evaluate<boolean>('document.querySelector(".panel img") === null && !window.bitten'),
  ).toBe(true);
  await whole(page);
}, 240_000);
