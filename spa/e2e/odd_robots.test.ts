import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { shownSeq } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

/** As in an iframe of another site, for which the browser blocks storage. */
const NO_STORAGE = `for (const name of ['localStorage', 'sessionStorage'])
  Object.defineProperty(window, name, { get() { throw new DOMException('denied', 'SecurityError'); } })`;

const rows = (page: Page) =>
  page.evaluate<string[]>(
    `[...document.querySelectorAll('.joints tbody tr')].filter((row) => !row.hidden).map((row) => row.dataset.label)`,
  );
const text = (page: Page, selector: string) =>
  page.evaluate<string>(`document.querySelector(${JSON.stringify(selector)})?.textContent ?? ''`);
const whole = async (page: Page) => {
  expect(await page.evaluate<boolean>('document.querySelector(".broken") === null')).toBe(true);
  const wide = await page.evaluate<number>('document.documentElement.scrollWidth - window.innerWidth');
  expect(wide, 'nothing sticks out').toBeLessThanOrEqual(0);
};

it('a board that falls silent, another set of joints and names that bite: table, card, plot and filter stand, without storage', async () => {
  const relay = await stage.stack.relay();
  const sample = { pos: { RKN: 0.4, LKN: 0.2, REB: 0.1 }, cur: { RKN: 1.5, LKN: 1, REB: 1 } };
  const first = stage.stack.fedEdge(relay, sample);
  const page = await stage.open(`${relay.url}/#/r/demo`, {
    preload: NO_STORAGE,
    viewport: { width: 1280, height: 800 },
  });
  await until('rows', async () => (await rows(page)).length === 3);
  await page.findByTestId('filter').type('kn');
  await until('filtered', async () => (await rows(page)).toSorted().join() === 'LKN,RKN');
  await page.findByTestId('angle').click();
  await until('degrees', async () => (await text(page, '.joints thead .c-pos')).includes('°'));
  await page.findByRole('button', /^RKN$/).click();
  await page.findByTestId('plot-cur').click();

  // the currents lose their readings while positions continue
  first.source.write(JSON.stringify({ pos: { ...sample.pos, LKN: 0.3 } }));
  const cur = 'td[data-field="cur"][data-label="RKN"]';
  await until('it is old', () =>
    page.evaluate<boolean>(`document.querySelector('${cur}').hasAttribute('data-old')`),
  );
  expect(await text(page, cur)).toContain('1.50');
  await until('its age', async () =>
    /^cur \d+(\.\d)? s old/.test(await text(page, 'tr[data-label="RKN"] .c-flags')),
  );
  await until('in the card, too', async () =>
    /last read \d.* ago/.test(await text(page, '[data-testid=joint-card]')),
  );
  await whole(page);

  // it returns as another robot, with arbitrary joint names
  first.edge.signal('SIGKILL');
  const odd = ['<img src=x onerror="window.bitten=true">', '__proto__', '=1+1', `LKN${'x'.repeat(190)}`];
  const values = (value: number) => Object.fromEntries(odd.map((name) => [name, value]));
  stage.stack.fedEdge(relay, { pos: values(0.5), cur: values(2) });
  await until('the filter holds', async () => (await rows(page)).join() === odd[3]);
  await until('the card says so', async () =>
    (await text(page, '[data-testid=joint-card]')).includes('This robot has no such joint now.'),
  );
  await page.findByRole('tab', /^Plots/).click();
  await until('the plot says so', async () =>
    (await text(page, '.panel .plot-legend')).includes('not reported now'),
  );
  await page.findByRole('tab', 'Joints').click();
  await page.press('Escape');
  await page.findByTestId('filter').type('');
  await until('all rows', async () => (await rows(page)).length === odd.length);
  for (const name of odd) {
    await page.evaluate(
      `[...document.querySelectorAll('.joints tbody tr')].find((row) => row.dataset.label === ${JSON.stringify(name)}).querySelector('button').click()`,
    );
    await until('its card', async () => (await text(page, '[data-testid=joint-card] h2')) === name);
    await page.findByTestId('plot-pos').click();
  }
  await page.findByRole('tab', /^Plots/).click();
  await until('all traces', () =>
    page.evaluate<boolean>(`document.querySelectorAll('[data-testid=trace]').length === ${odd.length + 1}`),
  );
  const seq = (await shownSeq(page)) ?? 0;
  await until('frames go on', async () => ((await shownSeq(page)) ?? 0) > seq + 3);
  expect(
    await page.evaluate<boolean>('document.querySelector(".panel img") === null && !window.bitten'),
  ).toBe(true);
  await whole(page);
}, 240_000);

it('names have one spelling in table and plots, and long ones are told apart', async () => {
  const relay = await stage.stack.relay();
  const long = ['2', '3'].map((v) => `arm_shoulder_pitch_actuator_joint_link_module_assembly_final_v${v}`);
  const names = ['می\u200cروم زانو', '🤖\u200d🚀 knee', 'a\u200cb', ...long];
  const wave = { pos: Object.fromEntries(names.map((name) => [name, [0.4, 0.5]])) };
  stage.stack.fedEdge(relay, { pos: Object.fromEntries(names.map((name) => [name, 0])), wave });
  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: { width: 390, height: 844 } });
  const plotted = () =>
    page.evaluate<{ label: string; shown: string; title: string; cut: boolean }[]>(
      `[...document.querySelectorAll('[data-testid=own-trace]')].map(({ dataset: { label }, children: [, name] }) =>
        ({ label, shown: name.textContent, title: name.title, cut: name.scrollHeight > name.clientHeight + 1 || name.scrollWidth > name.clientWidth + 1 }))`,
    );
  await until('all in plots', async () => (await plotted()).length === names.length);
  const found = await plotted();
  expect(new Set(found.map(({ shown }) => shown)).size).toBe(names.length);
  expect(found.filter(({ cut }) => cut)).toEqual([]);
  const inTable = (label: string) =>
    page.evaluate<string>(
      `(() => {
        const button = document.querySelector('.joints tr[data-label=' + JSON.stringify(${JSON.stringify(label)}) + '] button');
        return button.getAttribute('aria-label') ?? button.textContent;
      })()`,
    );
  for (const { label, title } of found) expect(title).toBe(`${await inTable(label)} pos`);
  const titles = found.map(({ title }) => title);
  expect(titles).toContain('\u2068می\u200cروم زانو\u2069 pos');
  expect(titles).toContain('🤖\u200d🚀 knee pos');
  expect(titles).toContain('a\\u{200c}b pos');
});

/** An arm without any visuals. */
const BARE_ARM = `<robot name="arm"><link name="base"/><link name="upper"/><link name="hand"/>
<joint name="lift" type="prismatic"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.4"/><axis xyz="0 0 1"/>
<limit lower="0" upper="0.5" effort="1" velocity="1"/></joint>
<joint name="bend" type="revolute"><parent link="upper"/><child link="hand"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>`;

it('a robot without a model plots itself; its skeleton takes that place, can be tapped, and stays in the picture up high', async () => {
  const relay = await stage.stack.relay();
  const pos = Object.fromEntries(['lift', ...'abcdefg', 'bend'].map((name) => [name, 0]));
  const upright = { 'base.w': 1, 'base.x': 0, 'base.y': 0, 'base.z': 0 };
  const at = (z: number) => ({ base: { 'base.x': 0, 'base.y': 0, 'base.z': z }, baseq: upright });
  const moving = { pos, ...at(0), wave: { pos: { bend: [0.5, 0.5] } } };
  const first = stage.stack.fedEdge(relay, moving);
  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: { width: 1280, height: 800 } });
  await page.evaluate('window.sameDocument = true');
  const legend = () =>
    page.evaluate<string[]>(
      `[...document.querySelectorAll('[data-testid=own-trace]')].map((entry) => entry.dataset.label)`,
    );
  await until('what moves is among the first', async () => (await legend()).includes('bend'));
  expect(await text(page, '[data-testid=self-plots]')).toContain('--urdf FILE');
  await page.viewport({ width: 390, height: 844 });
  const flagLines = `document.querySelector('.self-plots-say code').lastChild.getClientRects().length`;
  expect(await page.evaluate<number>(flagLines), 'lines that the flag stands on, on a phone').toBe(1);
  await page.viewport({ width: 1280, height: 800 });
  await page.findByTestId('self-plots-next').click();
  await until('the others, and where its base is', async () => (await legend()).includes('base.x'));
  await whole(page);

  first.edge.signal('SIGKILL');
  const urdf = path.join(stage.stack.folder(), 'arm.urdf');
  writeFileSync(urdf, BARE_ARM);
  const { source } = stage.stack.fedEdge(relay, moving, { urdf });
  const scene = <T>(code: string) => page.evaluate<T>(`window.posecast.scene${code}`);
  await until('its skeleton', () => scene<boolean>('?.triangles > 500'));
  expect(await page.findByTestId('self-plots').count()).toBe(0);
  expect(await page.evaluate<boolean>('window.sameDocument')).toBe(true);
  const tapped = `(() => {
    const { left, top, width, height } = document.querySelector('[data-testid="scene"] canvas').getBoundingClientRect();
    const found = new Set();
    for (let x = 0; x < width; x += 6) for (let y = 0; y < height; y += 6) found.add(window.posecast.scene.pick(left + x, top + y));
    return [...found].filter((link) => link !== null).sort().join();
  })()`;
  // the camera comes to it in a moment
  await until('each link can be tapped', async () => (await page.evaluate(tapped)) === 'base,hand,upper');

  const height = () => scene<number>('.eye.target[2]');
  const before = await height();
  source.write(JSON.stringify({ ...moving, ...at(25) }));
  await until('the camera is up there', async () => (await height()) > 24);
  source.write(JSON.stringify({ ...moving, ...at(0) }));
  await until('and back', async () => Math.abs((await height()) - before) < 0.2);
}, 240_000);
