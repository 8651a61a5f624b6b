import { describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { liveness, openNotices, renderedFrames, shownSeq } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** Keeps the extension object: it can't be requested after the context is lost. */
const KEEP = `(() => {
  const of = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    const context = of.call(this, kind, ...rest);
    if (kind === 'webgl2' && context !== null && this.parentNode === null) window.lost = context.getExtension('WEBGL_lose_context');
    return context;
  };
})()`;

const trouble = (page: Page) =>
  page.evaluate<string>('document.querySelector("[data-testid=view-note]")?.dataset.trouble ?? ""');

describe('a WebGL context that is lost', () => {
  it('three times comes back each time with no reload; a fourth time the body is drawn by hand', async () => {
    const relay = await stage.stack.demo();
    const page = await stage.open(`${relay.url}/#/r/demo`, {
      preload: KEEP,
      viewport: { width: 700, height: 500 },
    });
    await until(
      'a body',
      async () => (await page.evaluate<number>('window.posecast?.scene?.triangles ?? 0')) > 500,
    );
    await page.evaluate('window.born = true'); // a reload would forget it
    for (let loss = 1; loss <= 3; loss += 1) {
      await page.evaluate('window.lost.loseContext()');
      await until(`says so, loss ${loss}`, async () => (await trouble(page)) === 'lost');
      const seq = (await shownSeq(page)) ?? 0;
      const before = await renderedFrames(page);
      await until('the numbers go on', async () => ((await shownSeq(page)) ?? 0) > seq + 5);
      expect(await renderedFrames(page), 'nothing can be drawn meanwhile').toBe(before);
      await page.evaluate('window.lost.restoreContext()');
      await until(`drawn again, loss ${loss}`, async () => (await renderedFrames(page)) > before + 3);
      expect(await trouble(page)).not.toBe('lost');
      expect(await page.evaluate<number>('window.posecast.scene.triangles')).toBeGreaterThan(500);
    }
    await page.evaluate('window.lost.loseContext()');
    await until('given up', async () => (await trouble(page)) === 'given-up');
    await until(
      'drawn by hand',
      async () => (await page.evaluate<number>('window.posecast?.scene?.triangles ?? 0')) > 500,
    );
    const { length } = await page.evaluate<string[]>(
      '[...document.querySelectorAll("[data-testid=scene] canvas")].map(String)',
    );
    expect(length, 'one canvas').toBe(1);
    expect(await liveness(page)).toBe('LIVE');
    await openNotices(page);
    await page.findByRole('button', 'Try 3D again').click();
    await until('3D again', async () => /^(pixels|detail)?$/.test(await trouble(page)));
    await until(
      'a body again',
      async () => (await page.evaluate<number>('window.posecast?.scene?.triangles ?? 0')) > 500,
    );
    expect(await page.evaluate<boolean>('window.born')).toBe(true);
    page.forgive(/WebGL|CONTEXT_LOST/i);
  });
});
