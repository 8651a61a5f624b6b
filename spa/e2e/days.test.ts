import { createHash } from 'node:crypto';
import { mkdirSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { decodeSegment, type Segment } from '@posecast/wire';
import { expect, it } from 'vitest';
import { Month } from '../tests/rigs/past_month.ts';
import { violations } from './axe.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { chipText, enter, holds, is, testId, whole } from './robot_page.ts';
import type { Relay } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage({ webgl: false });

const LAPTOP = { width: 1366, height: 768 };
const LONG_ENOUGH_S = 14;

const has = (page: Page, selector: string) => () =>
  page.evaluate<boolean>(`document.querySelector('${selector}') !== null`);
const text = (page: Page, id: string) => page.evaluate<string>(`${testId(id)}?.textContent ?? ''`);
const momentMs = (page: Page) => page.evaluate<number | null>('window.posecast.twin.moment_ms');

const DAY_MS = 86_400_000;
const MIN_MS = 60_000;
const PAST = '/api/v1/robots/demo/past';

interface Summary {
  readonly from_ms: number | null;
  readonly to_ms: number | null;
}

const robot = stage.share(async (stack) => {
  const relay = await stack.relay({ past: 'memory:' });
  stack.edge(relay);
  return relay;
});
const watched = stage.share(async (_, newPage) => {
  const relay = await robot();
  await until(
    `${LONG_ENOUGH_S} s of past`,
    async () => {
      const { from_ms, to_ms } = (await relay.json(PAST)) as Summary;
      return from_ms !== null && to_ms !== null && to_ms - from_ms >= 1000 * LONG_ENOUGH_S;
    },
    120_000,
  );
  const page = await newPage({ viewport: LAPTOP });
  await page.open(`${relay.url}/#/r/demo`);
  await until('a body', () => whole(page));
  return page;
});

/** The demo robot's page, live, with some seconds to look back on. */
async function visit(): Promise<Page> {
  const page = await watched();
  await until('LIVE', is(page, 'LIVE'));
  const long = `(() => { const track = ${testId('track')}; return track !== null && track.ariaValueMax - track.ariaValueMin >= ${LONG_ENOUGH_S}; })()`;
  await until(`${LONG_ENOUGH_S} s on the line`, holds(page, long));
  return page;
}

/** Some complete segments that a relay has recorded, and their schema. */
async function taken(relay: Relay): Promise<{ segments: Segment[]; schemaText: string }> {
  const bytes = async (route: string) => new Uint8Array(await (await fetch(relay.url + route)).arrayBuffer());
  const found = await until('four segments', async () => {
    const { to_ms } = (await relay.json(PAST)) as Summary;
    if (to_ms === null) return null;
    const ten = `${new Date(to_ms).toISOString().slice(0, 15)}0Z`;
    const page = (await relay.json(`${PAST}/public/${ten}`)) as {
      segments: { take: string; index: number; frames: number }[];
    };
    const whole = page.segments.filter(({ frames }) => frames > 100);
    return whole.length >= 4 ? whole : null;
  });
  const segments: Segment[] = [];
  for (const { take, index } of found!)
    segments.push(decodeSegment(await bytes(`${PAST}/public/${take}/${index}`)));
  const text = await bytes(`${PAST}/public/schema/${segments[0]!.start.schema}`);
  return { segments, schemaText: new TextDecoder().decode(text) };
}

it('of days in a store the line shows what it needs, one goes there, and finds the faults of then', async () => {
  const { segments, schemaText } = await taken(await robot());

  const nowMs = Date.now();
  const faultMs = nowMs - 3 * DAY_MS - 10 * MIN_MS;
  const month = new Month(segments, {
    ...{ toMs: nowMs, schemaText },
    faults: (atMs) => (faultMs >= atMs && faultMs < atMs + MIN_MS ? 2 : 0),
  });
  const folder = stage.stack.folder();
  const write = (name: string, data: string | Uint8Array) => {
    mkdirSync(path.join(folder, path.dirname(name)), { recursive: true });
    writeFileSync(path.join(folder, name), data);
  };
  for (const agoDays of [1, 3, 20]) {
    const toMs = nowMs - agoDays * DAY_MS;
    for (const [name, bytes] of month.files({ fromMs: toMs - 16 * MIN_MS, toMs })) write(name, bytes);
  }
  write(`demo/schemas/${createHash('sha256').update(schemaText).digest('hex')}.json`, schemaText);
  const robots = path.join(stage.stack.folder(), 'robots.toml');
  const policy = '[robots.demo]\nkeep = "30d"\n[robots.demo.anyone]\npast = "30d"\n';
  writeFileSync(robots, policy, { mode: 0o600 });
  const relay = await stage.stack.demo({ past: `file://${folder}`, robots });
  await until('twenty days', async () => {
    const { from_ms } = (await relay.json(PAST)) as Summary;
    return from_ms !== null && from_ms < nowMs - 19 * DAY_MS;
  });

  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: LAPTOP });
  await until('LIVE', is(page, 'LIVE'));
  await until('a body', () => whole(page));
  await until('a line', has(page, '.track-ticks text'));
  const days = () => page.requested.filter((url) => /past\/public\/\d{4}-\d\d-\d\d$/.test(url)).length;
  expect(days(), 'of twenty days those that three hours touch').toBeLessThanOrEqual(2);

  // two taps
  await page.press('g');
  const hour = `[...document.querySelectorAll('.moment-hours button')].findLast((each) => each.ariaLabel.includes('yesterday'))`;
  await until('an hour of yesterday', holds(page, `${hour} !== undefined`));
  await page.evaluate(`${hour}.click()`);
  await until('PAST', is(page, 'PAST'));
  await until('yesterday', async () => {
    const agoMs = nowMs - ((await momentMs(page)) ?? nowMs);
    return agoMs > DAY_MS - MIN_MS && agoMs < DAY_MS + 17 * MIN_MS;
  });
  await until('a pose of then', holds(page, 'window.posecast.twin.seq !== null'));

  // a week
  const scale = () => page.evaluate<string>(`${testId('scale')}.value`);
  for (const ms of [DAY_MS, 7 * DAY_MS]) {
    await page.evaluate(`${testId('track')}.focus()`);
    await page.press('-');
    await until(`a line of ${ms / DAY_MS} days`, async () => (await scale()) === String(ms));
  }
  const counts = `[...document.querySelectorAll('.track-count')].map((each) => each.textContent)`;
  await until('two faults of three days ago', async () =>
    (await page.evaluate<string[]>(counts)).includes('2'),
  );

  // its faults
  await page.findByTestId('jump').click();
  await until('the sheet', has(page, '[data-testid="moment-sheet"][open]'));
  await page.evaluate(`document.querySelectorAll('.moment-ways input')[1].click()`);
  const row = `[...document.querySelectorAll('.incidents li button')].find((each) => /for 3.5 s/.test(each.textContent))`;
  await until('a fault of then', async () => {
    await page.evaluate(`document.querySelector('[data-testid="more-incidents"]')?.click()`);
    return page.evaluate<boolean>(`${row} !== undefined`);
  });
  await page.evaluate(`${row}.click()`);
  await until('what led to it', async () => {
    const atMs = (await momentMs(page)) ?? 0;
    return atMs > faultMs - MIN_MS - 3000 && atMs < faultMs + MIN_MS;
  });
}, 300_000);

interface Label {
  readonly words: string;
  readonly left: number;
  readonly right: number;
  readonly top: number;
  readonly bottom: number;
  readonly px: number;
}

it('the line has times at rest, which can be read and do not lie over one another', async () => {
  const page = await visit();
  for (const [width, height, px] of [
    [360, 640, 12],
    [390, 844, 12],
    [1366, 768, 12],
    [1920, 1080, 15],
  ] as const) {
    await page.viewport({ width, height });
    const labels = await until(`times at ${width} px`, async () => {
      const found = await page.evaluate<
        Label[]
      >(`innerWidth !== ${width} || Math.abs(document.querySelector('.track-picture').clientWidth - ${testId('track')}.clientWidth) > 1 ? [] :
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
  await page.viewport(LAPTOP);
}, 240_000);

it('one goes to a moment by its time, to an hour by two taps, and by the keyboard alone', async () => {
  const page = await visit();
  const wantedMs = Math.floor(Date.now() / 1000) * 1000 - 8000;
  await page.press('g');
  await until('the sheet', has(page, '[data-testid="moment-sheet"][open]'));
  await until('today, with an hour of it', has(page, '.moment-hours button'));
  const clock = new Date(wantedMs).toTimeString().slice(0, 8);
  await enter(page, testId('moment-time'), clock);
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

  // the clock time of then leads there too
  await page.evaluate(`document.querySelector('.transport-moment').click()`);
  await until('the sheet', has(page, '[data-testid="moment-sheet"][open]'));
  await enter(page, testId('moment-date'), '2001-02-03');
  await until('the oldest', async () => /^That is no longer kept/.test(await text(page, 'moment-hint')));
  await page.evaluate(`document.querySelector('.moment-hours button').click()`);
  await until('the oldest of that hour', async () => (await momentMs(page))! < wantedMs);
  expect(await page.evaluate<boolean>(`document.querySelector('dialog[open]') === null`)).toBe(true);
  await page.press('e');
  await until('LIVE', is(page, 'LIVE'));
}, 240_000);

it('the last faults are listed, and lead to two seconds before', async () => {
  const page = await visit();
  const faults = '.track-mark[data-level="fault"]';
  await until('a fault on the line', has(page, faults), 120_000);
  await page.findByTestId('jump').click();
  await until('the sheet', has(page, '[data-testid="moment-sheet"][open]'));
  await page.evaluate(`document.querySelectorAll('.moment-ways input')[1].click()`);
  await until('a fault', has(page, '.incidents li button'));
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
