import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { FaultyLink } from './proxy.ts';
import { holds } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

/** What a browser has few of, for all frames of a page. */

/** Chromium keeps sixteen contexts in a process. */
const COLUMN = FULL ? 20 : 10;
const MOST_CONTEXTS = 8;

/** Keeps each frame's WebGL contexts, to count those that are in use. */
const KEEP = `(() => {
  const of = HTMLCanvasElement.prototype.getContext;
  window.contexts = [];
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    const context = of.call(this, kind, ...rest);
    if (kind === 'webgl2' && context !== null) window.contexts.push(context);
    return context;
  };
})()`;

/** The page shows this many frames below each other, without its own content. */
const showFrames = (page: Page, count: number) =>
  page.evaluate(`(() => {
    document.body.replaceChildren(...Array.from({ length: ${count} }, (_, n) => {
      const frame = document.createElement('iframe');
      frame.style.cssText = 'display: block; width: 400px; height: 300px; margin: 20px';
      frame.src = './embed/?frame=' + n + '#/r/demo';
      return frame;
    }));
    for (const { style } of [document.documentElement, document.body]) style.cssText = 'height: auto; overflow: auto';
  })()`);

const showFrame = (page: Page, n: number) =>
  page.evaluate(`document.querySelectorAll('iframe')[${n}].scrollIntoView({ block: 'center' })`);

it('a column of frames shows 3D wherever one looks, with few WebGL contexts', async () => {
  const relay = await stage.demo();
  const page = await stage.open(`${relay.url}/#/`, { preload: KEEP, viewport: { width: 500, height: 700 } });
  await showFrames(page, COLUMN);
  const inUse = () =>
    page.evaluate<number>(`[...Array(${COLUMN}).keys()]
      .flatMap((n) => window.frames[n].contexts ?? [])
      .filter((context) => !context.isContextLost()).length`);
  const numbers = [...Array(COLUMN).keys()];
  const seen: number[] = [];
  const look = async (n: number, drawn: number) => {
    await showFrame(page, n);
    const frame = `window.frames[${n}]`;
    const scene = `${frame}.posecast?.scene`;
    await until(`frame ${n} is drawn`, () =>
      page.evaluate(`(${scene}?.renderedFrames ?? 0) > ${drawn} && (${scene}?.drawCalls ?? 0) > 2 &&
        ${frame}.contexts.some((context) => context.canvas.parentNode && !context.isContextLost()) &&
        ${frame}.document.querySelectorAll('[data-testid=scene] > canvas').length === 1`),
    );
    seen.push(await inUse());
  };
  for (const n of numbers) await look(n, 0);
  // those out of view keep their picture
  await until(
    'the first sleeps',
    holds(page, `window.frames[0].contexts.every((each) => each.isContextLost())`),
  );
  const still = `window.frames[0].document.querySelectorAll('[data-testid=scene] > canvas').length`;
  expect(await page.evaluate<number>(still), 'a picture in its place').toBe(2);
  for (const n of [0, COLUMN - 1, 1])
    await look(n, await page.evaluate<number>(`window.frames[${n}].posecast.scene.renderedFrames`));
  expect(Math.max(...seen)).toBeLessThanOrEqual(MOST_CONTEXTS);
  for (const n of numbers) {
    const troubles = `window.frames[${n}].document.querySelectorAll('[data-trouble=lost], [data-trouble=given-up]')`;
    expect(await page.evaluate<number>(`${troubles}.length`), `frame ${n}`).toBe(0);
  }
});

it('of nine tabs without a WebSocket, the one in front is LIVE, and holds the only stream', async () => {
  const relay = await stage.demo();
  const link = await FaultyLink.open(relay.port);
  link.fault({ stripUpgrade: true });
  try {
    // Chromium counts connections to a host for all tabs, as for all frames of a page; these are drawn by hand, to save time.
    const light = `localStorage.setItem('posecast.settings', '{"body":"light"}')`;
    const page = await stage.open(`${link.url}/#/`, {
      preload: light,
      viewport: { width: 500, height: 4000 },
    });
    await showFrames(page, 0);
    const bring = async (n: number, hidden: boolean) =>
      page.evaluate(`(() => {
        const { document, Event } = window.frames[${n}];
        Object.defineProperty(document, 'hidden', { value: ${hidden}, configurable: true });
        document.dispatchEvent(new Event('visibilitychange'));
      })()`);
    const viewers = async () => {
      const { robots } = (await relay.json('/api/v1/robots')) as { robots: { viewers: number }[] };
      return robots[0]?.viewers;
    };
    const isLive = (n: number) =>
      page.evaluate<boolean>(`window.frames[${n}]?.posecast?.twin?.liveness === 'LIVE' &&
        window.frames[${n}].posecast.link.carrier === 'events'`);
    const open = (n: number) =>
      page.evaluate(`(() => {
        const frame = document.createElement('iframe');
        frame.style.cssText = 'display: block; width: 400px; height: 300px';
        frame.src = './embed/?frame=${n}#/r/demo';
        document.body.append(frame);
      })()`);
    for (let n = 0; n < 9; n++) {
      await open(n);
      await until(`tab ${n} in front is LIVE`, () => isLive(n));
      if (n < 8) await bring(n, true);
    }
    await until('one stream', async () => (await viewers()) === 1);
    await bring(8, true);
    await until('no stream', async () => (await viewers()) === 0);
    await bring(2, false);
    await until('an earlier tab is LIVE again', () => isLive(2));
    await until('its stream', async () => (await viewers()) === 1);
  } finally {
    await link.close();
  }
});
