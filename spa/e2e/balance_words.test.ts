import { expect, it } from 'vitest';
import type { Page, Point } from './driver/page.ts';
import { until } from './driver/until.ts';
import { enter, gone, holds, is, KEEP_SAVED, newestSaved, savedCount, tapped, there } from './robot_page.ts';
import { DEMO, demoAt, type Moment } from './sign_words.ts';
import { setStage } from './stage.ts';

const stage = setStage();
/** The light view draws the same texts, and is faster. */
const LIGHT = `try { if (localStorage.getItem('posecast.settings') === null) localStorage.setItem('posecast.settings', '{"body":"light"}') } catch {}`;
const LAPTOP = { width: 1280, height: 800 };
const STANDING_S = 2;
const LEANING_S = 58;

/** The same moment without force under one foot. */
function without(foot: 'LF' | 'RF', moment: Moment): Moment {
  const light = (field: string, parts: readonly string[]) => ({
    ...moment[field],
    ...Object.fromEntries(parts.map((part) => [`${foot}.${part}`, 0])),
  });
  return { ...moment, ftf: light('ftf', ['fx', 'fy', 'fz']), ftm: light('ftm', ['mx', 'my', 'mz']) };
}

const line = (page: Page) =>
  page.evaluate<{ text: string; level: string; kind: string } | null>(`(() => {
    const found = document.querySelector('.stage [data-testid=balance-line]');
    if (found === null) return null;
    return {
      text: found.querySelector('span').textContent.replaceAll('\\u00a0', ' '),
      level: found.dataset.level,
      kind: found.dataset.kind,
    };
  })()`);
const says = (page: Page, what: string, words: RegExp) =>
  until(what, async () => {
    const now = await line(page);
    return now !== null && words.test(now.text) ? now : null;
  });
const spoken = async (page: Page) => (await page.findByTestId('spoken').text()).replaceAll('\u00a0', ' ');

const INSIDE = /^The centre of mass is \d+ mm inside the area it stands on\.$/;

const robot = stage.share(async (stack) => {
  const relay = await stack.relay();
  return { relay, ...stack.fedEdge(relay, demoAt(STANDING_S), DEMO) };
});
const watched = stage.share(async (_, newPage) => {
  const { relay } = await robot();
  const page = await newPage({ preload: `${LIGHT};${KEEP_SAVED}`, viewport: LAPTOP });
  await page.open(`${relay.url}/#/r/demo`);
  return page;
});

/** The page of the robot, which stands. */
async function standing() {
  const { relay, source } = await robot();
  source.write(JSON.stringify(demoAt(STANDING_S)));
  const page = await watched();
  await until('it stands', is(page, 'LIVE', 'HOLDING'));
  await says(page, 'inside', INSIDE);
  return { relay, source, page };
}

it('on a laptop the sentence stands on one line, in the middle of the body', async () => {
  const { relay, source } = await robot();
  source.write(JSON.stringify(demoAt(LEANING_S)));
  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: { width: 1440, height: 900 } });
  await says(page, 'inside', /inside the area/);
  await until('roll and pitch', holds(page, `document.querySelector('.stage-level')?.offsetWidth > 0`));
  const [height, off] = await page.evaluate<[number, number]>(`(() => {
    const line = document.querySelector('.stage .balance-line').getBoundingClientRect();
    const stage = document.querySelector('.stage').getBoundingClientRect();
    return [line.height, line.x + line.width / 2 - stage.x - stage.width / 2];
  })()`);
  expect(height).toBeLessThan(30);
  expect(Math.abs(off)).toBeLessThan(2);
});

it('one sentence tells whether it would fall and where to, to the eye and to the ear', async () => {
  const moment = demoAt(STANDING_S);
  const { source, page } = await standing();
  const first = await until('green', async () => {
    const now = await line(page);
    return now?.level === 'ok' ? now : null;
  });
  expect([first.level, first.kind]).toEqual(['ok', 'inside']);
  await until('said aloud', async () => /\. The centre of mass is \d+ mm inside/.test(await spoken(page)));
  await page.screenshot('balance-words.png');

  source.write(JSON.stringify(demoAt(LEANING_S)));
  await until('amber', async () => (await line(page))?.level === 'caution');
  expect((await line(page))?.text).toMatch(INSIDE);

  source.write(JSON.stringify(without('LF', moment)));
  const falls = await says(
    page,
    'outside',
    /^It would fall to its left: the centre of mass is \d+ mm outside\.$/,
  );
  expect(falls.level).toBe('fault');
  await until('said aloud', async () => /It would fall to its left/.test(await spoken(page)));

  source.write(JSON.stringify(without('LF', without('RF', moment))));
  await says(page, 'no foot', /^No foot bears weight\.$/);

  source.write(JSON.stringify({ ...moment, ftf: { ...moment.ftf, 'RF.fz': null } }));
  await says(page, 'no reading', /^A foot has no force reading/);
  const filled = await page.evaluate<string>(
    `getComputedStyle(document.querySelector('.stage .balance-mark')).backgroundColor`,
  );
  expect(filled, 'what nobody knows is not green').toBe('rgba(0, 0, 0, 0)');

  source.write(JSON.stringify(without('LF', without('RF', moment))));
  await says(page, 'no foot again', /^No foot bears weight\.$/);
  source.signal('SIGSTOP');
  await until('STALE', is(page, 'STALE'));
  await says(page, 'the past tense', /^No foot bore weight\.$/);
  expect((await line(page))?.level).toBe('old');
  source.signal('SIGCONT');
});

it('the menu switches it off and on, says why it can’t be, and explains it; so does the sentence', async () => {
  const { page } = await standing();
  const mark = () =>
    page.evaluate<Point>(`(() => {
      const { left, top, width, height } = document.querySelector('.stage .balance-line .explain-mark').getBoundingClientRect();
      return { x: left + width / 2, y: top + height / 2 };
    })()`);
  const explained = () =>
    page.evaluate<string>(`document.querySelector('[data-testid=explained]')?.textContent ?? ''`);
  await tapped(
    'explained', // once the explanations have loaded
    async () => page.click(await mark()),
    async () => /margin.*tipping over/.test(await explained()),
  );
  await page.press('Escape');

  const press = (selector: string) =>
    page.evaluate(`document.querySelector(${JSON.stringify(selector)}).click()`);
  await press('[data-testid=signs] button');
  await until('the entry', there(page, 'balance-entry'));
  expect(await page.findByTestId('balance-entry').text()).toMatch(/^Balance/);
  const kept = () =>
    page.evaluate<string>(`JSON.parse(localStorage.getItem('posecast.settings') ?? '{}').balance`);
  await press('[data-testid=balance-entry] input');
  await until('no sentence', async () => (await line(page)) === null);
  expect(await kept()).toBe('off');
  await press('[data-testid=balance-entry] input');
  await says(page, 'again', /inside/);
  expect(await kept(), 'as it is by itself').toBe('auto');
  await page.screenshot('balance-menu.png');
  await page.press('Escape');
  await until('no menu', gone(page, 'balance-entry'));
});

it('its margin goes into a plot with all of the minute, into the table that is saved, and has limits', async () => {
  const { source, page } = await standing();
  await page.findByRole('tab', 'Sensors').click();
  await until('its numbers', there(page, 'balance-table'));
  await page.screenshot('balance-sensors.png');
  await page.findByTestId('plot-margin').click();
  await page.findByRole('tab', /^Plots/).click();
  const value = () =>
    page.evaluate<string>(
      `document.querySelector('[data-testid=trace][data-field=balance] .c-num')?.textContent.trim() ?? ''`,
    );
  await until('a number', async () => /^\d+\.\d$/.test(await value()));
  await page.screenshot('balance-plot.png');
  const csv = await until('a table of several margins', async () => {
    const before = await savedCount(page);
    await page.findByTestId('plot-csv').click();
    await until('it is saved', async () => (await savedCount(page)) > before);
    const saved = new TextDecoder().decode((await newestSaved(page)).bytes);
    return saved.split('\r\n').filter((row) => /,\d+(\.\d+)?$/.test(row)).length > 5 ? saved : null;
  });
  expect(csv.split('\r\n')[0]).toBe('"time","Balance: margin [mm]"');

  const low = '[data-testid="limit-balance-margin"] .number-field:nth-of-type(1) input';
  await page.findByRole('button', 'Settings').click();
  await until('limits', holds(page, `document.querySelector(${JSON.stringify(low)}) !== null`));
  await enter(page, `document.querySelector(${JSON.stringify(low)})`, '99');
  await page.screenshot('balance-limits.png');
  await page.press('Escape');
  await until('red by that limit', async () => (await line(page))?.level === 'fault');
  await page.findByRole('tab', 'Alarms').click();
  const alarms = async () => page.findByTestId('alarms').text();
  await until('the crossing', async () => /Balance margin below 99 mm.*your limit/s.test(await alarms()));

  await page.evaluate(`localStorage.removeItem('posecast.limits.demo')`);
  await page.reload();
  await says(page, 'inside', /inside/);
  source.write(JSON.stringify(without('LF', demoAt(STANDING_S))));
  await says(page, 'outside', /outside/);
  await page.findByRole('tab', 'Alarms').click();
  await until('by the page’s own', async () => /Balance margin below 0 mm/.test(await alarms()));
  expect(await alarms()).not.toContain('your limit');
  await page.findByRole('tab', 'Joints').click();
});

it('large where it is presented, slim in a frame, short beside others; how much of its way a joint has left', async () => {
  const { relay, page } = await standing();
  await page.evaluate(`document.querySelector('tr[data-label="RKN"] button').click()`);
  await until('what is left', async () =>
    /left to the limit .*[\d.]+ rad to its (lower|upper) limit, \d+ % of its range/.test(
      await page.findByTestId('joint-room').text(),
    ),
  );
  await page.press('Escape');
  await page.press('p');
  await until(
    'presented',
    holds(page, `/inside/.test(document.querySelector('.present-balance')?.textContent ?? '')`),
  );
  await page.screenshot('balance-presented.png');
  await page.press('Escape');

  await page.viewport({ width: 360, height: 300 });
  await page.open(`${relay.url}/embed/#/r/demo`);
  await says(page, 'in a frame', /inside/);
  await page.screenshot('balance-embed.png');

  await page.viewport(LAPTOP);
  await page.open(`${relay.url}/r/demo+nobody`);
  const brief = () =>
    page.evaluate<string>(
      `document.querySelector('[data-testid=line-demo] .balance-line')?.textContent ?? ''`,
    );
  await until('beside others', async () => /^\d+\u00a0mm inside$/.test(await brief()));
  await page.screenshot('balance-row.png');
});
