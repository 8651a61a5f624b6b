import { describe, expect, it } from 'vitest';
import { sampleChain, writeBuilt } from './built_model.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { openNotices } from './robot_page.ts';
import { staysWatchable } from './slow_device.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const ratio = (page: Page) => page.evaluate<number>('window.posecast?.scene?.pixelRatio ?? 0');
const trouble = (page: Page) =>
  page.evaluate<string>('document.querySelector("[data-testid=view-note]")?.dataset.trouble ?? ""');
const shells = (page: Page) => page.evaluate<number>('window.posecast?.scene?.triangles ?? 0');

/** Many pixels in software are as slow as any phone; a fast machine is made to wait between repaints. */
const LONG_REPAINTS = `(() => {
  const of = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (tick) =>
    of((ms) => (window.hurry ? tick(ms) : setTimeout(() => tick(performance.now()), 70)));
})()`;

/** No settings: the page decides automatically. */
const AS_IT_COMES = `try { localStorage.setItem('posecast.settings', '{}') } catch {}`;

describe.skipIf(!FULL)('a slow device', () => {
  it('gets ten poses a second, in 3D or, where that is too slow, by hand', async (context) => {
    stage.needs(context, 'slow');
    const relay = await stage.stack.demo();
    const page = await stage.open(`${relay.url}/#/r/demo`, {
      viewport: { width: 390, height: 700 },
      preload: AS_IT_COMES,
    });
    await until('a body', async () => (await shells(page)) > 500);
    await staysWatchable(page, async () => (await trouble(page)) === 'slow');
  });

  it('too slow for 3D goes over to the light view by itself and says so; asked to stay in 3D, it stays', async () => {
    const relay = await stage.stack.demo();
    const page = await stage.open(`${relay.url}/#/r/demo`, {
      viewport: { width: 390, height: 700 },
      preload: `${AS_IT_COMES};${LONG_REPAINTS.replace('70', '130')}`,
    });
    await until('3D', async () => (await shells(page)) > 500 && (await trouble(page)) !== 'slow');
    await until('by hand', async () => (await trouble(page)) === 'slow', 120_000);
    await until('a body', async () => (await shells(page)) > 500);
    expect(await page.findByTestId('view-note').text()).toMatch(/too slow for 3D.*light view/);
    await openNotices(page);
    await page.findByRole('button', 'Try 3D again').click();
    await until('3D again', async () => (await trouble(page)) !== 'slow' && (await shells(page)) > 500);
    expect(await page.evaluate<string>('window.posecast.settings.body')).toBe('3d');
    const before = await page.evaluate<number>('window.posecast.scene.renderedFrames');
    await until(
      'as many pictures as it took before, and more',
      async () => (await page.evaluate<number>('window.posecast.scene.renderedFrames')) > before + 100,
      120_000,
    );
    await until('it says so', async () => (await trouble(page)) === 'detail');
  });

  it('gets the light view when the person wants it, and with it ten poses a second', async (context) => {
    stage.needs(context, 'slow');
    const relay = await stage.stack.demo();
    // A slow repaint, as on a device with a weak GPU.
    const page = await stage.open(`${relay.url}/#/r/demo`, {
      viewport: { width: 390, height: 700 },
      preload: LONG_REPAINTS,
    });
    await until(
      'it is offered',
      async () => (await trouble(page)) === 'pixels' || (await trouble(page)) === 'detail',
    );
    await page.evaluate('window.hurry = true'); // the GPU was the reason
    await openNotices(page);
    await page.findByRole('button', 'Light view').click();
    await until(
      'drawn by hand',
      async () => (await trouble(page)) === 'chosen' && (await shells(page)) > 500,
    );
    await staysWatchable(page);
    await openNotices(page);
    await page.findByRole('button', 'Back to 3D').click();
    await until('3D', async () => (await trouble(page)) !== 'chosen');
  });

  it('gives up pixels, then detail, and says so; at rest all its pixels are there', async () => {
    const relay = await stage.stack.relay();
    const files = await writeBuilt(stage.stack.folder(), sampleChain(60));
    const swinging = { pos: { joint1: 0.3 }, wave: { pos: { joint2: [0.5, 0.5] } } };
    const { source } = stage.stack.fedEdge(relay, swinging, { model: files.folder });
    const page = await stage.open(`${relay.url}/#/r/demo`, {
      preload: LONG_REPAINTS,
    });
    await until('a body', async () => (await shells(page)) > 500);
    const whole = await ratio(page);
    await until('lower resolution', async () => (await ratio(page)) < whole);
    await until('it says so', async () => /pixels|detail/.test(await trouble(page)));
    const fine = await shells(page);
    await until('less detail', async () => (await trouble(page)) === 'detail');
    await until('less detail', async () => (await shells(page)) <= fine);
    expect(await page.findByTestId('view-note').text()).toMatch(/slow/);
    source.write(JSON.stringify({ pos: { joint1: 0.3, joint2: 0 } }));
    await until('sharp at rest', async () => (await ratio(page)) === whole);
  });
});
