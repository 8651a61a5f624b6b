import { expect, it } from 'vitest';
import type { Page, Point, Viewport } from './driver/page.ts';
import { until } from './driver/until.ts';
import type { Process } from './process.ts';
import { hasSkin, holds, resting, tapped } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();
const PHONE = { width: 390, height: 844 };
const LAPTOP = { width: 1280, height: 800 };

/** The demo robot with its jammed knee, standing still; every change of a link's appearance is recorded. */
async function jammed(viewport: Viewport): Promise<{ page: Page; source: Process }> {
  const relay = await stage.stack.relay();
  const { source } = stage.stack.fedEdge(relay, demoAt(42), DEMO);
  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport });
  await until('a body', () => hasSkin(page));
  await until('its tree', holds(page, 'window.posecast.scene.tree() !== null'));
  await page.evaluate(`(() => {
    const { scene } = window.posecast;
    const look = scene.setLinkLook;
    window.lit = {};
    scene.setLinkLook = (link, how) => {
      if (how.highlight) window.lit[link] = how.highlight;
      else delete window.lit[link];
      look.call(scene, link, how);
    };
  })()`);
  await still(page);
  return { page, source };
}

const still = (page: Page) => until('the picture rests', () => resting(page));
const lit = (page: Page) => page.evaluate<string[]>('Object.keys(window.lit)');
const cardOf = (page: Page) =>
  page.evaluate<string>('document.querySelector("[data-testid=joint-card]")?.ariaLabel ?? ""');
const target = (page: Page) => page.evaluate<number[]>('window.posecast.scene.eye.target');

/** A link's origin in the world, metres. */
const originOf = (page: Page, link: string) =>
  page.evaluate<number[]>(
    `(() => { const m = window.posecast.scene.linkPoses()[${JSON.stringify(link)}]; return [m[3], m[7], m[11]]; })()`,
  );

const apart = (a: readonly number[], b: readonly number[]) =>
  Math.hypot(...a.map((value, i) => value - b[i]!));

/** The middle of the visible part of this link, where a person would tap: at its rim, a label or sign may receive the tap. */
function pointOf(page: Page, link: string): Promise<Point> {
  return until(`${link} in the picture`, () =>
    page.evaluate<Point | null>(`(() => {
      const { scene } = window.posecast;
      const { left, top, right, bottom } = document.querySelector('[data-testid="scene"] canvas').getBoundingClientRect();
      const is = (x, y) => scene.pick(x, y) === ${JSON.stringify(link)};
      const seen = [];
      for (let y = top + 60; y < bottom - 60; y += 4)
        for (let x = left + 20; x < right - 20; x += 4)
          if (is(x, y) && is(x - 3, y) && is(x + 3, y) && is(x, y + 3)) seen.push({ x, y });
      const mean = (axis) => seen.reduce((sum, point) => sum + point[axis], 0) / seen.length;
      const middle = { x: mean('x'), y: mean('y') };
      const away = ({ x, y }) => Math.hypot(x - middle.x, y - middle.y);
      return seen.sort((a, b) => away(a) - away(b))[0] ?? null;
    })()`),
  );
}

it('a joint that stalls is found from page load in two taps at most: its row, its link, its card', async () => {
  for (const [name, viewport] of Object.entries(FULL ? { phone: PHONE, laptop: LAPTOP } : { phone: PHONE })) {
    const { page, source } = await jammed(viewport);
    await until('its row on top', holds(page, 'document.querySelector("tbody tr")?.dataset.label === "RKN"'));
    await page.findByRole('button', /^RKN$/).click();
    await until('its card', async () => (await cardOf(page)) === 'RKN');
    await until('its link is lit', async () => (await lit(page)).includes('Body_RKN'));
    expect(await lit(page)).toEqual(['Body_RKN']);
    const knee = await originOf(page, 'Body_RKN');
    await until('the eye is there', async () => apart(await target(page), knee) < 0.005);
    await still(page);
    await page.screenshot(`card-${name}.png`);

    await page.press('Escape');
    await until('no card', async () => (await cardOf(page)) === '');
    await until('dark again', async () => (await lit(page)).length === 0);

    // normal, and then the same joint stalls without any flag: one tap
    const { flags, ref, ...rest } = demoAt(42);
    const quiet = { ...rest, flags: { ...flags, RKN: ['homed', 'enabled'] } };
    const line = () => page.findByTestId('fault-line').text();
    source.write(JSON.stringify({ ...quiet, ref: { ...ref, RKN: rest.pos!.RKN } }));
    await until('the flag is over', async () => /^Earlier: [\s\S]*· ended /.test(await line()));
    await page.findByTestId('acknowledge').click();
    await until('all is well', async () => (await line()) === 'No faults');
    source.write(JSON.stringify({ ...quiet, ref }));
    await until('it stalls', async () =>
      /^Right knee is not where it was told to be: 0\.\d\d rad off/.test(await line()),
    );
    await page.findByRole('button', /told to be/).click();
    await until('its card', async () => (await cardOf(page)) === 'RKN');
    await page.findByTestId('acknowledge').click();
    await until('quiet', async () => (await line()) === 'No faults');
    await page.close();
  }
}, 240_000);

it('a tapped link finds its row and opens its card, and the eye stays where it is', async () => {
  const { page } = await jammed(LAPTOP);
  await page.findByRole('button', 'side').click();
  let before = await target(page);
  await tapped(
    'its card',
    async () => {
      await still(page); // parts of the body that load meanwhile may move the picture
      before = await target(page);
      await page.click(await pointOf(page, 'Body_RAP'));
    },
    async () => (await cardOf(page)) === 'RAP',
  );
  const row = () =>
    page.evaluate<{ marked: string; seen: boolean }>(`(() => {
      const row = document.querySelector('tr[aria-current]');
      const { top, bottom } = row.getBoundingClientRect();
      const room = document.querySelector('.table-room').getBoundingClientRect();
      return { marked: row.dataset.label, seen: top >= room.top && bottom <= room.bottom + 1 };
    })()`);
  await until('its row is marked and seen', async () => {
    const { marked, seen } = await row();
    return marked === 'RAP' && seen;
  });
  expect(await lit(page)).toContain('Body_RAP');
  await still(page);
  expect(apart(await target(page), before)).toBeLessThan(1e-6);

  // a filter that hides the row is cleared
  await page.evaluate('document.querySelector(".filter").focus()');
  await page.findByTestId('filter').type('shoulder');
  await until('filtered', holds(page, 'document.querySelector(\'tr[data-label="RKN"]\').hidden'));
  const knee = await pointOf(page, 'Body_RKN');
  await tapped(
    'its row',
    () => page.click(knee),
    async () => (await row()).marked === 'RKN' && (await row()).seen,
  );
}, 240_000);
