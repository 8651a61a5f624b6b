import { expect, it } from 'vitest';
import type { Page, Point } from './driver/page.ts';
import { until } from './driver/until.ts';
import { finest, holds, is, tapped } from './robot_page.ts';
import { DEMO, demoAt, signs } from './sign_words.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const JAMMED = {
  flags: { RKN: ['homed', 'enabled', 'jam'] },
  wave: { pos: { RKN: [0.4, 0.05] } },
  ref: { RKN: 0.9 },
  volt: { main: 48 },
};
const jammed = stage.share(async (stack) => {
  const relay = await stack.relay();
  stack.fedEdge(relay, JAMMED, { profile: 'demo' });
  return relay;
});

const press = (page: Page, selector: string) =>
  page.evaluate<boolean>(`(() => {
    const found = document.querySelector(${JSON.stringify(selector)});
    found?.focus(); found?.click();
    return found !== null;
  })()`);

/** The text of the open explanation, as screen readers get it; empty if there is none. */
const explained = (page: Page) =>
  page.evaluate<string>(`(() => {
    const dialog = document.querySelector('[role="dialog"][data-testid="explained"]');
    if (dialog === null) return '';
    const text = (name) => document.getElementById(dialog.getAttribute(name))?.textContent ?? '';
    const { left, top, right, bottom } = dialog.getBoundingClientRect();
    const inside = left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
    return [text('aria-labelledby'), text('aria-describedby'), inside ? '' : 'outside'].join('|');
  })()`);

async function asks(page: Page, selector: string, said: RegExp): Promise<void> {
  await until(
    `${selector} is there`,
    holds(page, `document.querySelector(${JSON.stringify(selector)}) !== null`),
  );
  await until(`${selector} explains itself`, async () => {
    if ((await explained(page)) === '') await press(page, selector);
    return said.test(await explained(page));
  });
  await page.press('Escape');
  await until('closed', async () => (await explained(page)) === '');
}

it('columns, units, flags and sensors explain themselves when they are pressed, on a phone and a laptop', async () => {
  const relay = await jammed();
  for (const viewport of [
    { width: 360, height: 640 },
    { width: 1280, height: 800 },
  ]) {
    const page = await stage.open(`${relay.url}/#/r/demo`, { viewport });
    await until('LIVE', is(page, 'LIVE'));
    await asks(page, '.joints thead .c-pos .term', /^pos\|Where the joint is\..*rad.*6\.28 rad.*\|$/s);
    expect(
      await page.evaluate<boolean>('document.activeElement.dataset.explain === "columns.pos"'),
      'the focus goes back',
    ).toBe(true);
    await asks(page, '.joints thead .c-pos .unit', /^rad\|A unit of angle.*\|$/s);
    await asks(page, '.fault-line [data-explain="flag"]', /^jam\|Right knee is blocked\./);
    await page.findByRole('tab', 'Sensors').click();
    await asks(page, '.sensor .kind', /\|.+/s);

    await press(page, '.sensor .kind');
    await until('explained', async () => (await explained(page)) !== '');
    await page.findByTestId('all-explained').click();
    const all = () => page.findByTestId('glossary').text();
    await until('everything', async () =>
      /STALE.*ghost.*IMU.*N·m.*The joint is blocked\./s.test(await all().catch(() => '')),
    );
    await page.close();
  }
});

it('joints are named in plain words where the settings say so', async () => {
  const relay = await jammed();
  const page = await stage.open(`${relay.url}/#/r/demo`);
  await until('LIVE', is(page, 'LIVE'));
  const name = () =>
    page.evaluate<string>(`document.querySelector('tr[data-label="RKN"] th button')?.textContent ?? ''`);
  await until('the code', async () => (await name()) === 'RKN');
  await page.findByRole('button', 'Settings').click();
  await until('settings', () => press(page, '[name="names"]:not(:checked)'));
  await page.press('Escape');
  await until('plain words', async () => /^right knee|^…?knee/.test(await name()));
});

/** A point beside the middle of a force arrow, away from the body, and the nearest point on the arrow. */
const besideArrow = (page: Page, site: string, px: number) =>
  page.evaluate<{ beside: Point; on: Point } | null>(`(() => {
    const { scene } = window.posecast;
    const wrench = scene.signs.wrenches.find(({ site }) => site === ${JSON.stringify(site)});
    const { left, top } = document.querySelector('[data-testid="scene"] canvas').getBoundingClientRect();
    const m = scene.rig.screenFromWorld();
    const place = (p) => {
      const [x, y, w] = [0, 4, 8].map((row) => m[row] * p[0] + m[row + 1] * p[1] + m[row + 2] * p[2] + m[row + 3]);
      return { x: left + x / w, y: top + y / w };
    };
    const [from, to] = [place(wrench.at), place(wrench.tip)];
    const long = Math.hypot(to.x - from.x, to.y - from.y);
    for (const part of [0.5, 0.3, 0.7, 0.9]) {
      const on = { x: from.x + (to.x - from.x) * part, y: from.y + (to.y - from.y) * part };
      for (const side of [1, -1]) {
        const away = (${px} * side) / long;
        const beside = { x: on.x - (to.y - from.y) * away, y: on.y + (to.x - from.x) * away };
        if (scene.pick(beside.x, beside.y) === null) return { beside, on };
      }
    }
    return null;
  })()`);

it('an arrow that moves explains itself, green and all, by a tap 15 px beside it; a joint near it is still chosen', async () => {
  const relay = await stage.stack.relay();
  const arm = { pos: { RSP: [0.35, 0.15] }, ftf: { 'RH.fz': [3, 0.3] } };
  const moment = demoAt(2);
  stage.stack.fedEdge(relay, { ...moment, ftf: { ...moment.ftf, 'RH.fx': 12 }, wave: arm }, DEMO);
  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: { width: 1280, height: 800 } });
  await until('shells', () => finest(page));
  await until('arrows', async () => (await signs(page)).wrenches.length === 4);
  const seen: Point[] = [];
  for (let moment = 0; moment < 2; moment++) {
    await tapped(
      'its explanation',
      async () => {
        const { beside, on } = await until('a point beside the arrow, elsewhere than before', async () => {
          const found = await besideArrow(page, 'RH', 15);
          const apart = ({ x, y }: Point) => Math.hypot(x - found!.on.x, y - found!.on.y);
          return found !== null && seen.every((point) => apart(point) > 4) ? found : null;
        });
        seen.push(on);
        await page.click(beside);
      },
      async () =>
        /^arrow at a hand or foot\|.*Green is fine, yellow is close to a limit, red is past it/.test(
          await explained(page),
        ),
    );
    await page.press('Escape');
    await until('closed', async () => (await explained(page)) === '');
  }
  const thigh = () =>
    page.evaluate<Point | null>(`(() => {
      const { scene } = window.posecast;
      const { left, top, right, bottom } = document.querySelector('[data-testid="scene"] canvas').getBoundingClientRect();
      for (let y = top + 60; y < bottom - 60; y += 4)
        for (let x = left + 20; x < right - 20; x += 4)
          if ([-9, 0, 9].every((by) => scene.pick(x + by, y) === 'Body_LHP' && scene.pick(x, y + by) === 'Body_LHP'))
            return { x, y };
      return null;
    })()`);
  await tapped(
    "the thigh's card",
    async () => page.click(await until('the thigh', thigh)),
    holds(page, 'document.querySelector("[data-testid=joint-card]")?.ariaLabel.startsWith("LH") ?? false'),
  );
  expect(await explained(page)).toBe('');
});
