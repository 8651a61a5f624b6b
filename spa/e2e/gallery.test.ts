import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { violations } from './axe.ts';
import { engineName } from './driver/engines.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { Host } from './host.ts';
import { holds } from './robot_page.ts';
import { REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const MOMENTS = ['walking', 'knee', 'lean', 'drone'];
/** The frame is of the guide's own origin, so its page can be looked into from there. */
const FRAME = `document.querySelector('.moment iframe')?.contentWindow`;

/** Where a recorded frame's body stands, and which frame it is of; null while there is none. */
const shown = (page: Page) =>
  page.evaluate<{ seq: number; links: Record<string, number[]> } | null>(`(() => {
    const { twin, scene } = ${FRAME}?.posecast ?? {};
    const links = scene?.linkPoses() ?? {};
    return twin?.seq == null || Object.keys(links).length === 0 ? null : { seq: twin.seq, links };
  })()`);

async function press(page: Page, moment: string): Promise<void> {
  await page.evaluate(
    `(() => {
      const poster = document.querySelector('.moment > a[href="gallery/${moment}/index.html"]');
      poster.scrollIntoView({ block: 'center' });
      poster.click();
    })()`,
  );
}

/** Presses a poster and waits until the body of its frame has moved by itself. */
async function watch(page: Page, moment: string): Promise<void> {
  await press(page, moment);
  await until(`a body in the frame of ${moment}`, async () => (await shown(page)) !== null);
  const first = await shown(page);
  await until(`it moves in ${moment}`, async () => {
    const now = await shown(page);
    return now !== null && now.seq > (first?.seq ?? 0) && differ(now.links, first?.links ?? {}) > 0.005;
  });
}

/** The largest difference of two bodies' links, in metres or in an element of their turns. */
function differ(a: Record<string, readonly number[]>, b: Record<string, readonly number[]>): number {
  const differences = Object.entries(a).flatMap(([link, pose]) =>
    pose.map((value, i) => Math.abs(value - (b[link]?.[i] ?? value))),
  );
  return Math.max(0, ...differences);
}

const countFrames = (page: Page) =>
  page.evaluate<number[]>(
    `['.moment iframe', '.moment > a'].map((each) => document.querySelectorAll(each).length)`,
  );

describe.each([
  { name: 'phone', width: 390, height: 844, scheme: 'dark' },
  { name: 'laptop', width: 1440, height: 900, scheme: 'light' },
] as const)('the gallery that the relay serves, on a $name', ({ name, width, height, scheme }) => {
  it('shows posters, and plays the one that is pressed', async () => {
    const relay = await stage.stack.relay();
    const page = await stage.newPage({
      viewport: { width, height },
      ...(stage.browser.lacks.media === undefined ? { media: { scheme } } : {}),
    });
    page.forgive(/WebGL/);
    await page.open(`${relay.url}/guide/gallery/`); // as people type it
    await until('the posters', async () => (await countFrames(page))[1] === MOMENTS.length);
    expect(await page.evaluate<string>('location.pathname')).toBe('/guide/gallery.html');
    expect(page.requested.filter((url) => /\.glb|\.segment|recording/.test(url))).toEqual([]);
    const wide = await page.evaluate<number>('document.documentElement.scrollWidth - innerWidth');
    expect(wide, 'pixels beside the screen').toBeLessThanOrEqual(0);
    expect(await violations(page)).toEqual([]);
    await page.screenshot(`gallery-${name}-${engineName()}.png`);
    for (const moment of FULL || name === 'phone' ? MOMENTS : ['drone']) {
      await watch(page, moment);
      expect(await countFrames(page), 'one plays at a time').toEqual([1, MOMENTS.length - 1]);
      await page.screenshot(`gallery-${moment}-${name}-${engineName()}.png`);
    }
    if (stage.browser.lacks.media === undefined) {
      const theme = await page.evaluate<string>(`${FRAME}.document.documentElement.dataset.theme`);
      expect(theme).toBe(scheme);
    }
  });
});

it('plays on a static host below any path', async () => {
  const host = await Host.open(path.join(REPO, 'out/site'), '/~lab/guide/');
  try {
    const page = await stage.newPage();
    page.forgive(/WebGL/);
    await page.open(`${host.url}/~lab/guide/gallery.html`);
    await until('the posters', async () => (await countFrames(page))[1] === MOMENTS.length);
    await watch(page, 'knee');
    const whole = await page.evaluate<string>(`${FRAME}.document.querySelector('footer a').href`);
    await page.open(whole);
    await until(
      'the whole page',
      holds(page, `document.querySelector('[data-testid="about-button"]') !== null`),
    );
    expect(new URL(whole).pathname).toBe('/~lab/guide/gallery/knee/index.html');
  } finally {
    await host.close();
  }
});
