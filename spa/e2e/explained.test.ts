import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { liveness } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const JAMMED = {
  flags: { RKN: ['homed', 'enabled', 'jam'] },
  wave: { pos: { RKN: [0.4, 0.05] } },
  ref: { RKN: 0.9 },
  volt: { main: 48 },
};

const press = (page: Page, selector: string) =>
  page.evaluate<boolean>(`(() => {
    const found = document.querySelector(${JSON.stringify(selector)});
    found?.focus(); found?.click();
    return found !== null;
  })()`);

/** What the open explanation says, also to a screen reader; empty while there is none. */
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
  await until(`${selector} is there`, () =>
    page.evaluate<boolean>(`document.querySelector(${JSON.stringify(selector)}) !== null`),
  );
  await until(`${selector} explains itself`, async () => {
    if ((await explained(page)) === '') await press(page, selector);
    return said.test(await explained(page));
  });
  await page.press('Escape');
  await until('closed', async () => (await explained(page)) === '');
}

it('columns, units, flags and sensors explain themselves when they are pressed, on a phone and a laptop', async () => {
  const relay = await stage.stack.relay();
  stage.stack.fedEdge(relay, JAMMED, { profile: 'demo' });
  for (const viewport of [
    { width: 360, height: 640 },
    { width: 1280, height: 800 },
  ]) {
    const page = await stage.newPage({ viewport });
    await page.open(`${relay.url}/#/r/demo`);
    await until('LIVE', async () => (await liveness(page)) === 'LIVE');
    await asks(page, '.joints thead .c-pos .term', /^pos\|Where the joint is\..*rad.*6\.28 rad.*\|$/s);
    expect(
      await page.evaluate<boolean>('document.activeElement.dataset.explain === "columns.pos"'),
      'the focus goes back',
    ).toBe(true);
    await asks(page, '.joints thead .c-pos .unit', /^rad\|A way to measure an angle.*\|$/s);
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
  const relay = await stage.stack.relay();
  stage.stack.fedEdge(relay, JAMMED, { profile: 'demo' });
  const page = await stage.newPage();
  await page.open(`${relay.url}/#/r/demo`);
  await until('LIVE', async () => (await liveness(page)) === 'LIVE');
  const name = () =>
    page.evaluate<string>(`document.querySelector('tr[data-label="RKN"] th button')?.textContent ?? ''`);
  await until('the code', async () => (await name()) === 'RKN');
  await page.findByRole('button', 'Settings').click();
  await until('settings', () => press(page, '[name="names"]:not(:checked)'));
  await page.press('Escape');
  await until('plain words', async () => /^right knee|^…?knee/.test(await name()));
});
