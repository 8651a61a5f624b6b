import { describe, expect, it } from 'vitest';
import { engineName } from './driver/engines.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { holds, is, renderedFrames } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
/** As on an iPhone, and in an iframe without permission. */
const NONE = `Object.defineProperty(Document.prototype, 'fullscreenEnabled', { get: () => false });
delete Element.prototype.requestFullscreen;`;

async function opened(preload?: string): Promise<Page> {
  const relay = await stage.stack.demo();
  const page = await stage.open(`${relay.url}/#/r/demo`, {
    viewport: { width: 390, height: 844 },
    ...(preload === undefined ? {} : { preload }),
  });
  await until('LIVE', is(page, 'LIVE', 'HOLDING'));
  return page;
}

const state = (page: Page) => page.findByTestId('robot-page').attribute('data-fullscreen');

describe('fullscreen', () => {
  it('is the screen where the browser gives it', async () => {
    const page = await opened();
    await page.findByRole('button', 'Fullscreen').click();
    await until('the whole screen', holds(page, 'document.fullscreenElement !== null'));
    await until('the page knows', async () => (await state(page)) === 'screen');
    await page.findByRole('button', 'Fullscreen').click();
    await until('back', async () => (await state(page)) === 'off');
  });

  it.skipIf(!FULL)(
    'is the whole page where the browser has none, with the liveness still in view',
    async () => {
      const page = await opened(NONE);
      await page.findByRole('button', 'Fullscreen').click();
      await until('the page', async () => (await state(page)) === 'page');
      const body = `(({ top, width, height }) => ({ top, width, height }))(
      document.querySelector('[data-testid="scene"]').getBoundingClientRect())`;
      await until('the body fills it', async () => {
        const { top, width, height: exact } = await page.evaluate<DOMRect>(body);
        const height = Math.round(exact);
        if (top === 0 && width === 390 && height === 844) return true;
        throw new Error(JSON.stringify({ top, width, height }));
      });
      expect(await page.findByTestId('liveness').visible()).toBe(true);
      expect(await page.findByRole('table').count()).toBe(0);
      await page.screenshot(`fullscreen-${engineName()}.png`);
      await page.press('Escape');
      await until('back', async () => (await state(page)) === 'off');
      await page.press('f');
      await until('again', async () => (await state(page)) === 'page');
      await page.findByRole('button', 'Fullscreen').click();
      await until('back again', async () => (await state(page)) === 'off');
      const pictures = await renderedFrames(page);
      await until('the body in its half', async () => (await renderedFrames(page)) > pictures + 3);
      await page.screenshot(`phone-${engineName()}.png`);
    },
  );
});
