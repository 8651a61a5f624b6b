import { expect, it } from 'vitest';
import { violations } from './axe.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { chipText, liveness, whole } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage({ webgl: false });

const testId = (id: string) => `document.querySelector('[data-testid="${id}"]')`;
const is = (page: Page, word: string) => async () => (await liveness(page)) === word;
const has = (page: Page, selector: string) => () =>
  page.evaluate<boolean>(`document.querySelector('${selector}') !== null`);
const text = (page: Page, id: string) => page.evaluate<string>(`${testId(id)}?.textContent ?? ''`);
const momentMs = (page: Page) => page.evaluate<number | null>('window.posecast.twin.moment_ms');

/** Fills a field as a person does who types. */
const type = (page: Page, id: string, value: string) =>
  page.evaluate(`(() => {
    const field = ${testId(id)};
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(field, '${value}');
    field.dispatchEvent(new Event('input', { bubbles: true }));
  })()`);

/** The demo robot's page, with so many seconds to look back on. */
async function visit(seconds: number): Promise<Page> {
  const relay = await stage.stack.relay({ past: 'memory:' });
  stage.stack.edge(relay);
  const page = await stage.newPage({ viewport: { width: 1366, height: 768 } });
  await page.open(`${relay.url}/#/r/demo`);
  await until('LIVE', is(page, 'LIVE'), 60_000);
  await until('a body', () => whole(page), 60_000);
  const long = `(() => { const track = ${testId('track')}; return track !== null && track.ariaValueMax - track.ariaValueMin >= ${seconds}; })()`;
  await until(`${seconds} s of past`, () => page.evaluate<boolean>(long), 120_000);
  return page;
}

interface Label {
  readonly words: string;
  readonly left: number;
  readonly right: number;
  readonly top: number;
  readonly bottom: number;
  readonly px: number;
}

it('the line has times at rest, which can be read and do not lie over one another', async () => {
  const page = await visit(12);
  for (const [width, height, px] of [
    [360, 640, 12],
    [390, 844, 12],
    [1366, 768, 12],
    [1920, 1080, 15],
  ] as const) {
    await page.viewport({ width, height });
    const labels = await until(`times at ${width} px`, async () => {
      const found = await page.evaluate<Label[]>(`innerWidth !== ${width} ? [] :
        [...document.querySelectorAll('.track-ticks text')].map((label) => {
          const { left, right, top, bottom } = label.getBoundingClientRect();
          return { words: label.textContent, left, right, top, bottom, px: parseFloat(getComputedStyle(label).fontSize) };
        })`);
      return found.length > 0 && found.every((label) => label.px === px) ? found : null;
    });
    const line = await page.evaluate<Label>(
      `(() => { const { left, right, top, bottom } = ${testId('time-line')}.getBoundingClientRect(); return { left, right, top, bottom }; })()`,
    );
    for (const [i, label] of labels!.entries()) {
      expect(label.words).toMatch(/^\d\d:\d\d(:\d\d)?$/);
      expect(label.right).toBeLessThan(labels![i + 1]?.left ?? width);
      expect([label.top >= line.top, label.left >= 0, label.bottom <= height + 3]).toEqual([
        true,
        true,
        true,
      ]);
    }
  }
}, 240_000);

it('one goes to a moment by its time, to an hour by two taps, and by the keyboard alone', async () => {
  const page = await visit(14);
  const wantedMs = Math.floor(Date.now() / 1000) * 1000 - 8000;
  await page.press('g');
  await until('the sheet', has(page, '[data-testid="moment-sheet"][open]'));
  await until('today, with an hour of it', has(page, '.moment-hours button'));
  const clock = new Date(wantedMs).toTimeString().slice(0, 8);
  await type(page, 'moment-time', clock);
  await until(
    'it was recorded',
    async () => (await text(page, 'moment-hint')) === 'This moment was recorded.',
  );
  expect(await violations(page)).toEqual([]);
  await page.evaluate(`${testId('moment-go')}.focus()`);
  await page.press('Enter');
  await until('PAST', is(page, 'PAST'));
  await until('that moment', async () => Math.abs((await momentMs(page))! - wantedMs) < 1000);
  expect(await chipText(page)).toContain(clock);

  // the clock of then leads there, too
  await page.evaluate(`document.querySelector('.transport-moment').click()`);
  await until('the sheet', has(page, '[data-testid="moment-sheet"][open]'));
  await type(page, 'moment-date', '2001-02-03');
  await until('the oldest', async () => /^That is no longer kept/.test(await text(page, 'moment-hint')));
  await page.evaluate(`document.querySelector('.moment-hours button').click()`);
  await until('the oldest of that hour', async () => (await momentMs(page))! < wantedMs);
  expect(await page.evaluate<boolean>(`document.querySelector('dialog[open]') === null`)).toBe(true);
  await page.press('e');
  await until('LIVE', is(page, 'LIVE'));
}, 240_000);

it('the last faults are listed, and lead to two seconds before', async () => {
  const page = await visit(14);
  const faults = '.track-mark[data-level="fault"]';
  await until('a fault on the line', has(page, faults), 120_000);
  await page.findByTestId('jump').click();
  await until('the sheet', has(page, '[data-testid="moment-sheet"][open]'));
  await page.evaluate(`document.querySelectorAll('.moment-ways input')[1].click()`);
  await until('a fault', has(page, '.incidents li button'), 30_000);
  await until('nothing is looked for', async () => {
    const said = await page.evaluate<string>(
      `document.querySelector('.incidents [role=status]').textContent`,
    );
    return /^These are all/.test(said);
  });
  expect(await page.evaluate<string>(`document.querySelector('.incidents li').textContent`)).toMatch(
    /^\d\d:\d\d:\d\d.*knee.*RKN/,
  );
  expect(await violations(page)).toEqual([]);
  await page.evaluate(`document.querySelector('.incidents li button').click()`);
  await until('PAST', is(page, 'PAST'));
}, 300_000);
