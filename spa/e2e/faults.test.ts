import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { expect, it } from 'vitest';
import { CLOUD } from './cloud.ts';
import { freePort } from './driver/free_port.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { holds, is, RECORD } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();
const PHONE = { width: 390, height: 844 };
const LAPTOP = { width: 1280, height: 800 };

const FINE = {
  flags: { RKN: ['homed', 'enabled'] },
  wave: { pos: { RKN: [0.4, 0.5] }, ref: { RKN: [0.4, 0.5] } },
};
const JAMMED = { ...FINE, flags: { RKN: ['homed', 'enabled', 'jam'] } };

/** Keeps all that the line has said. */
const LINES = `
  window.lines = [];
  new MutationObserver(() => {
    const said = document.querySelector('[data-testid=fault-line]')?.textContent;
    if (said && said !== window.lines.at(-1)) window.lines.push(said);
  }).observe(document, { subtree: true, childList: true, characterData: true });
`;

const line = (page: Page) =>
  page.evaluate<string>('document.querySelector("[data-testid=fault-line]").textContent');
const row = (page: Page) =>
  page.evaluate<{ latched: string; flags: string; first: string | null }>(`(() => {
    const row = document.querySelector('tr[data-label="RKN"]');
    return {
      latched: row.dataset.latched,
      flags: row.querySelector('[data-field="flags"]').textContent,
      first: row.parentElement.firstElementChild.dataset.label,
    };
  })()`);

const robot = stage.share(async (stack, newPage) => {
  const relay = await stack.relay();
  const { source } = stack.fedEdge(relay, FINE, { profile: 'demo' });
  const page = await newPage({ viewport: LAPTOP });
  await page.open(`${relay.url}/#/r/demo`);
  return { source, page };
});

/** The page of a robot all of whose faults are over and acknowledged. */
async function calm() {
  const { source, page } = await robot();
  source.write(JSON.stringify(FINE));
  await until('LIVE', is(page, 'LIVE'));
  await until('no faults', async () => {
    if ((await line(page)) === 'No faults') return true;
    await page.evaluate(`document.querySelector('[data-testid=acknowledge]')?.click()`);
    return false;
  });
  return { source, page };
}

it('a fault of 30 ms stays until it is acknowledged in this browser, also after a reload', async () => {
  const relay = await stage.stack.relay();
  const { source } = stage.stack.fedEdge(relay, FINE, { profile: 'demo' });
  const page = await stage.open(`${relay.url}/#/r/demo`, { preload: RECORD });
  await until('LIVE', is(page, 'LIVE'));
  await until('no faults', async () => (await line(page)) === 'No faults');

  source.write(JSON.stringify({ ...JAMMED, once: true }));
  await until('it is over, and still there', async () => (await row(page)).latched === 'over');
  const told = /^Earlier: Right knee is blocked\.RKN · jam · ended/;
  await until('in a sentence', async () => told.test(await line(page)));
  expect(await row(page)).toMatchObject({ flags: 'jam, ended', first: 'RKN' });

  await page.open(`${relay.url}/?again#/r/demo`);
  await until(
    'the relay tells it again',
    async () => (await row(page).catch(() => null))?.latched === 'over',
  );
  await page.findByTestId('acknowledge').click();
  await until('acknowledged', async () => (await row(page)).latched === '');
  await until('no faults', async () => (await line(page)) === 'No faults');

  await page.open(`${relay.url}/?third#/r/demo`);
  await until('LIVE', is(page, 'LIVE'));
  await until('no faults', async () => (await line(page)) === 'No faults');

  source.write(JSON.stringify(JAMMED));
  await until('the next one', async () => (await row(page)).latched === 'lasts');
  await page.findByTestId('acknowledge').click();
  await until('quiet, and not gone', async () => (await line(page)) === '1 fault, acknowledged');
});

it('stays when the relay restarts and only its past has it', async () => {
  const robots = path.join(stage.stack.folder(), 'robots.toml');
  writeFileSync(robots, '[robots.demo]\nkeep = "1d"\n[robots.demo.anyone]\npast = "1d"\n', { mode: 0o600 });
  const past = `file://${stage.stack.folder()}`;
  const options = { past, robots, httpPort: await freePort(), zenohPort: await freePort() };
  const relay = await stage.stack.relay(options);
  const { source } = stage.stack.fedEdge(relay, FINE, { profile: 'demo' });
  const first = await stage.open(`${relay.url}/#/r/demo`);
  await until('no faults', async () => (await line(first)) === 'No faults');
  source.write(JSON.stringify({ ...JAMMED, once: true }));
  const told = /^Earlier: Right knee is blocked\.RKN · jam · ended/;
  await until('in a sentence', async () => told.test(await line(first)));
  await first.close();
  await relay.process.stop();

  await stage.stack.relay(options);
  const page = await stage.open(`${relay.url}/#/r/demo`, { preload: LINES });
  await until('the past tells', async () => told.test(await line(page)));
  expect(await page.evaluate('window.lines')).not.toContain('No faults');
  await page.findByTestId('acknowledge').click();
  await until('acknowledged', async () => (await line(page)) === 'No faults');
});

it('the words of an alarm lead to its moment, as its time does', async (context) => {
  if (CLOUD !== null) context.skip('needs a relay that is sure to keep the past');
  const { source, page } = await calm();
  source.write(JSON.stringify({ ...JAMMED, once: true }));
  await page.findByRole('tab', /^Alarms/).click();
  await until('the past is kept', holds(page, 'document.querySelectorAll(".alarms .when").length > 1'));
  const middleOf = (selector: string) =>
    page.evaluate<{ x: number; y: number }>(`(() => {
      const { left, top, width, height } = document.querySelector('${selector}').getBoundingClientRect();
      return { x: left + width / 2, y: top + height / 2 };
    })()`);
  const term = await middleOf('.open-faults .term');
  expect(
    await page.evaluate<boolean>(
      `document.elementFromPoint(${term.x}, ${term.y}).matches('.open-faults .term')`,
    ),
    'its other buttons lie above',
  ).toBe(true);
  await page.click(await middleOf('[data-testid="alarms"] .alarm-words'));
  await until('PAST', is(page, 'PAST'));
  await page.findByTestId('to-live').click();
  await page.findByRole('tab', 'Joints').click();
});

it('is found in one tap: the line opens the joint, with its last minute and what happened', async () => {
  const { source, page } = await calm();
  source.write(JSON.stringify(JAMMED));
  for (const viewport of [PHONE, LAPTOP]) {
    await page.viewport(viewport);
    await until('the fault is told', async () =>
      (await line(page).catch(() => '')).startsWith('Right knee is'),
    );
    await page.findByRole('button', /^Right knee is blocked/).click();
    const card = page.findByTestId('joint-card');
    await until('its card', async () => (await card.count()) === 1);
    const text = () =>
      page.evaluate<string>('document.querySelector("[data-testid=joint-card]").textContent');
    const points = () =>
      page.evaluate<number>('document.querySelector(".trace-pos").getAttribute("d").split(/[ML]/).length');
    await until('a strip that grows', async () => (await points()) > 5);
    expect(await text()).toMatch(
      /RKN.*right knee.*\d\d:\d\d:\d\dRight knee is blocked.*jam.*still there.*position.*reference/s,
    );
    await page.press('Escape');
    await until('the table again', async () => (await card.count()) === 0);
  }
});

it('stands first in its line, whole, on every size; the button makes room, and the line says how often', async () => {
  const apart = { ...FINE, wave: { pos: { RKN: [0.4, 0.05] } }, ref: { RKN: 0.9 } };
  const broken = { ...apart, flags: { RKN: ['homed', 'enabled', 'bigError'], LKN: [] } };
  const { source, page } = await calm();
  await page.viewport({ width: 360, height: 640 });
  source.write(JSON.stringify({ ...broken, flags: { ...broken.flags, LKN: ['jam'] }, once: true }));
  await until('the first time', async () => /^Earlier: (Right|Left) knee is/.test(await line(page)));
  source.write(JSON.stringify(broken));
  await until('in a sentence, with its age', async () =>
    /^Right knee is not where it was told to be: 0\.\d\d rad off for \d+ s\.RKN · big error · 2nd time in 10 min/.test(
      await line(page),
    ),
  );
  for (const [width, height] of [
    [360, 640],
    [820, 1180],
    [1280, 800],
  ] as const) {
    await page.viewport({ width, height });
    const cut = () =>
      page.evaluate<string>(`(() => {
        const what = document.querySelector('.fault-what'), button = document.querySelector('[data-testid=acknowledge]');
        const line = document.querySelector('.fault-line').getBoundingClientRect();
        const [said, done] = [what.getBoundingClientRect(), button.getBoundingClientRect()];
        const wrong = [];
        if (what.scrollWidth > what.clientWidth || what.scrollHeight > what.clientHeight + 1) wrong.push('cut');
        if (said.left > line.left + 40 || said.bottom > line.bottom + 1) wrong.push('not first');
        if (done.right > Math.min(line.right, innerWidth) || done.bottom > line.bottom + 1) wrong.push('button');
        if (!(done.left >= said.right || done.top >= said.bottom - 1)) wrong.push('over one another');
        return wrong.join(', ');
      })()`);
    await until(`whole at ${width}: ${await cut()}`, async () => (await cut()) === '');
  }
  expect(await page.findByTestId('acknowledge').attribute('aria-label')).toBe('Acknowledge all');
});
