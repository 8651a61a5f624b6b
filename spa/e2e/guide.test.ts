import { describe, expect, it } from 'vitest';
import { violations } from './axe.ts';
import { engineName } from './driver/engines.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { holds } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const shared = stage.share((stack) => stack.relay());
const SIZES = [
  { name: 'phone', width: 390, height: 844 },
  { name: 'laptop', width: 1440, height: 900 },
];

/** Searches the guide for the word. */
async function findsHolding(page: Page, name: string): Promise<void> {
  await until('a field to type in', async () => {
    const isOpen = await page.evaluate<boolean>('document.activeElement !== document.body');
    if (!isOpen) await page.press('Control+k');
    return isOpen;
  });
  for (const letter of 'HOLDING') await page.press(letter);
  await until('the index was asked for', async () =>
    page.requested.some((url) => url.endsWith('/guide/search.js')),
  );
  const results = `[...document.querySelectorAll('body > div')].map((each) => each.shadowRoot?.textContent ?? '').join()`;
  await until('results, with the word', holds(page, `${results}.includes('HOLDING')`));
  await page.press('Enter');
  await until('a page that explains it', holds(page, 'location.search === "?h=HOLDING"'));
  await page.loaded();
  await until(
    'the word is marked',
    holds(page, `[...document.querySelectorAll('mark')].some((mark) => mark.innerText === 'HOLDING')`),
  );
  expect(await violations(page)).toEqual([]);
  await page.screenshot(`guide-found-${name}-${engineName()}.png`);
}

/** The guide as served by the relay at /guide/, with its content policy. The stage checks that no request leaves the machine and
 *  no error is logged. */
describe.each(SIZES)('the guide on a $name', ({ name, width, height }) => {
  it.each(FULL ? (['light', 'dark'] as const) : ([name === 'phone' ? 'light' : 'dark'] as const))(
    'opens with four doors, %s; where it is light one finds HOLDING there, and what explains it',
    async (scheme) => {
      const relay = await shared();
      const page = await stage.open(`${relay.url}/guide/`, {
        viewport: { width, height },
        ...(stage.browser.lacks.media === undefined ? { media: { scheme } } : {}),
      });
      await until('doors', holds(page, 'document.querySelectorAll(".doors a").length >= 4'));
      const wide = await page.evaluate<number>('document.documentElement.scrollWidth - innerWidth');
      expect(wide, 'pixels beside the screen').toBeLessThanOrEqual(0);
      const left = await page.evaluate<number>('document.querySelector("h1").getBoundingClientRect().left');
      expect(left, 'pixels beside the text').toBeGreaterThanOrEqual(12);
      expect(await violations(page)).toEqual([]);
      if (stage.browser.lacks.media === undefined) {
        const ground = await page.evaluate<string>('getComputedStyle(document.body).backgroundColor');
        expect(ground).toBe(scheme === 'dark' ? 'rgb(14, 17, 22)' : 'rgb(247, 248, 250)');
      }
      await page.screenshot(`guide-${name}-${scheme}-${engineName()}.png`);
      if (scheme === 'light') await findsHolding(page, name);
    },
  );
});

it('is linked from the settings of the page', async () => {
  const relay = await shared();
  const page = await stage.open(`${relay.url}/`);
  await page.findByRole('button', 'Settings').click();
  const link = page.findByTestId('guide');
  await until('the link', () => link.visible());
  expect(await link.attribute('href')).toBe(`${relay.url}/guide/`);
});

it('a page that is not there is one line and a way back', async () => {
  const relay = await shared();
  const page = await stage.open(`${relay.url}/guide/how-to/no/such.html`);
  page.forgive(/404/); // the browser logs it
  expect(await page.text()).toContain('No such page');
  await page.findByRole('link', 'search the guide').click();
  await until('the guide', holds(page, 'document.querySelector(".doors") !== null'));
});
