/** How many poses reach the screen, on this machine and on one with a sixth of its processor speed. */

import { expect } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';

const TIMES_SLOWER = 6;
const LEAST_POSES_PER_SECOND = 10;
const COUNTED_SECONDS = 4;
const MOST_ROUNDS = 15;

/** Pictures with a new pose, per second of the page's own time. */
function posesPerSecond(page: Page): Promise<number> {
  return page.evaluate<number>(`new Promise((done) => {
    const begun = performance.now();
    let poses = 0, view = null, pictures = 0, pose = '';
    const look = (now) => {
      const { scene } = window.posecast; // a different one, or none, while the page switches views
      if (scene !== null && (scene !== view || scene.renderedFrames !== pictures)) {
        const shown = Object.values(scene.linkPoses()).slice(0, 40).map((m) => m[3].toFixed(6)).join();
        if (scene === view && shown !== pose) poses += 1;
        view = scene;
        pictures = scene.renderedFrames;
        pose = shown;
      }
      if (now - begun > ${COUNTED_SECONDS * 1000}) done(poses / ((now - begun) / 1000));
      else requestAnimationFrame(look);
    };
    requestAnimationFrame(look);
  })`);
}

/** With the processor slowed down six times, at least ten poses a second reach the screen; if the machine is so busy that it does
 *  not reach forty otherwise, at least a quarter of its rate. `settled`: it will not get faster automatically. */
export async function staysWatchable(
  page: Page,
  settled: () => Promise<boolean> = async () => false,
): Promise<void> {
  await until('it moves', async () => (await posesPerSecond(page)) > 1);
  const usual = await posesPerSecond(page);
  await page.slow(TIMES_SLOWER);
  // Time to settle.
  for (let i = 0; i < MOST_ROUNDS; i += 1) {
    if ((await posesPerSecond(page)) >= LEAST_POSES_PER_SECOND || (await settled())) break;
  }
  const slowed = Math.max(await posesPerSecond(page), await posesPerSecond(page));
  const again = await (async () => {
    await page.slow(1);
    return posesPerSecond(page);
  })();
  const note = await page.evaluate<string>(
    'document.querySelector("[data-testid=view-note]")?.textContent ?? ""',
  );
  console.info(
    `${usual.toFixed(1)} poses a second; with a sixth of the processor ${slowed.toFixed(1)}; afterwards ${again.toFixed(1)}. ${note}`,
  );
  const fair = Math.min(LEAST_POSES_PER_SECOND, Math.min(usual, again) / 4);
  expect(slowed).toBeGreaterThanOrEqual(fair);
}
