import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { findWrong } from './layout/findings.ts';
import { tooSmall } from './layout/legible.ts';
import { readShown } from './layout/shown.ts';
import { holds, there } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const CHOSEN = `try { localStorage.setItem('posecast.settings', '{"body":"light","load":"cur"}') } catch {}`;
/** In portrait, the texts are above and below the body. */
const UPRIGHT = { width: 768, height: 1024 };
const PROJECTORS = [{ width: 1920, height: 1080 }, ...(FULL ? [{ width: 3840, height: 2160 }] : [])];

const presented = (page: Page) =>
  page.evaluate<boolean>(
    `document.querySelector('[data-present=true]') !== null && document.querySelector('[data-testid=presentation]') !== null`,
  );
const hash = (page: Page) => page.evaluate<string>('location.hash');

/** What covers the body. */
function overBody(page: Page): Promise<string[]> {
  return page.evaluate<string[]>(`(() => {
    const body = document.querySelector('.stage').getBoundingClientRect();
    return [...document.querySelectorAll('.present-left, .present-faults, .present-address')]
      .filter((said) => {
        const { top, bottom, height } = said.getBoundingClientRect();
        return height > 0 && top < body.bottom - 1 && bottom > body.top + 1;
      })
      .map(({ className }) => className);
  })()`);
}

it('is read from the last row: by key, by the sheet, by a link, also in a frame', async () => {
  const relay = await stage.stack.relay();
  stage.stack.fedEdge(relay, demoAt(42), DEMO);
  const page = await stage.open(`${relay.url}/#/`, { preload: CHOSEN, media: { motion: 'reduce' } });
  await page.findByTestId('robot-demo').click();
  await until('the fault', async () => /RKN/.test(await page.findByTestId('fault-line').text()));
  await until('a body', holds(page, '(window.posecast?.scene?.triangles ?? 0) > 1000'));
  await page.press('p');
  await until('presented', () => presented(page));
  await until('in the address', async () => (await hash(page)) === '#/r/demo?load=cur&present');
  expect(await page.findByTestId('present-faults').text()).toMatch(
    /Right knee is blocked: 0\.\d+ rad off for [\d.]+ s\.\s*RKN/,
  );
  expect(await page.findByTestId('present-address').text()).toContain(`${relay.host}/#/r/demo`);

  await page.press('Escape');
  await until('the page again', async () => !(await presented(page)));
  await until('not in the address', async () => !/present/.test(await hash(page)));
  await until('its bar', holds(page, `document.querySelector('.top').checkVisibility()`));
  await page.viewport({ width: 390, height: 844 });
  await page.press('s');
  await until('the sheet', there(page, 'present'));
  await page.evaluate(`document.querySelector('[data-testid=present]').click()`);
  await until('presented', () => presented(page));
  await until('legible', async () => (await tooSmall(page)).length === 0);
  expect(findWrong(await readShown(page))).toEqual([]);
  await page.screenshot('present-phone.png');
  await page.press('p');
  await until('the page again', async () => !(await presented(page)));

  await page.viewport({ width: 960, height: 540 });
  await page.open(`${relay.url}/embed/demo#/r/demo?present`);
  await until('a frame in slides', () => presented(page));
  await until('legible', async () => (await tooSmall(page)).length === 0);
  await page.screenshot('present-embed.png');
  // the largest last: 4K pictures in software keep a busy machine busy for a long time
  await page.open(`${relay.url}/?again#/r/demo?present`);
  await until('opened so', () => presented(page));
  for (const size of PROJECTORS) {
    for (const [language, theme] of [
      ['en', 'dark'],
      ['ko', 'light'],
    ]) {
      const inForce = () => page.evaluate<boolean>(`document.documentElement.lang === '${language}'`);
      // retry if needed: the page writes its address itself
      await until('its language', async () => {
        await page.evaluate(
          `location.hash = '#/r/demo?joint=RKN&present&language=${language}&theme=${theme}'`,
        );
        return until('in force', inForce, 3000).catch(() => false);
      });
      await until('the joint', there(page, 'present-joint'));
      await page.viewport(size);
      await until('large enough', async () => {
        const small = await tooSmall(page);
        if (small.length > 0) throw new Error(small.join('; '));
        return true;
      });
      // after a change of picture size, labels and legend follow a moment later
      await until('nothing over anything', async () => {
        const wrong = findWrong(await readShown(page));
        if (wrong.length > 0) throw new Error(wrong.join('; '));
        return true;
      });
    }
    await page.viewport(UPRIGHT);
    await until('beside the body', async () => (await overBody(page)).length === 0);
  }
});
