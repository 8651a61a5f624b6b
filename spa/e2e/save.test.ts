import { execFile } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { promisify } from 'node:util';
import { decodeRecording, decodeSegment, type PastRecording } from '@posecast/wire';
import { unzipSync } from 'fflate';
import { expect, it } from 'vitest';
import { violations } from './axe.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { showIn } from './layout/sizes.ts';
import {
  enter,
  gone,
  is,
  KEEP_SAVED,
  liveness,
  newestSaved,
  savedCount,
  testId,
  textOf,
  there,
  whole,
} from './robot_page.ts';
import { REPO, type Relay } from './stack.ts';
import { FULL, type Stage, setStage } from './stage.ts';

const stage = setStage();
const run = promisify(execFile);

const PHONE = { width: 390, height: 844 };
const LAPTOP = { width: 1440, height: 900 };
const LONG_ENOUGH_S = 12;

/** A page that looks back on the demo robot, with some seconds of past. */
async function lookBack(relay: Relay, newPage: Stage['newPage'] = stage.newPage): Promise<Page> {
  const page = await newPage({ preload: KEEP_SAVED, viewport: LAPTOP });
  await page.open(`${relay.url}/#/r/demo`);
  await until('LIVE', is(page, 'LIVE'));
  await until('a body', () => whole(page));
  const has = `(() => {
    const track = ${testId('track')};
    return track !== null && track.ariaValueMax - track.ariaValueMin >= ${LONG_ENOUGH_S};
  })()`;
  await until(`${LONG_ENOUGH_S} s of past`, () => page.evaluate<boolean>(has));
  await isPast(page);
  return page;
}

/** Once it has been played to its end, the page is live again. */
const isPast = (page: Page) =>
  until('PAST', async () => {
    if ((await liveness(page)) === 'PAST') return true;
    await page.findByTestId('play').click();
    return until('PAST', is(page, 'PAST'), 3000).catch(() => false);
  });

const robot = stage.share(async (stack, newPage) => {
  const relay = await stack.relay({ past: 'memory:' });
  stack.edge(relay);
  return { relay, page: await lookBack(relay, newPage) };
});

async function openSheet(page: Page): Promise<void> {
  await until('a button that saves', () => page.findByTestId('save-button').visible());
  await page.findByTestId('save-button').click();
  await until('what there is', async () => /frames, about/.test(await textOf(page, 'save-measure')));
  const isClosed = async () => (await page.findByTestId('save-until').count()) === 0;
  await until('all of it, which the relay has yet to close', isClosed);
}

/** Saves in a format. Returns the file's name and bytes. */
async function save(page: Page, format: string): Promise<{ name: string; bytes: Uint8Array }> {
  const before = await savedCount(page);
  await page.evaluate(`${testId(`save-${format}`)}.click()`);
  const isReady = `!${testId('save-go')}?.disabled && ${testId('save-go')} !== null`;
  await until(`${format} is measured`, () => page.evaluate<boolean>(isReady));
  await page.evaluate(`${testId('save-go')}.click()`);
  await until(`${format} is saved`, async () => (await savedCount(page)) > before);
  await until('it says so', async () => /^Saved: /.test(await textOf(page, 'save-outcome')));
  return newestSaved(page);
}

it.each(FULL ? [LAPTOP, PHONE] : [LAPTOP])(
  'saves what is looked back on in each format, at $width px',
  async (viewport) => {
    const { relay, page } = await robot();
    await page.viewport(viewport);
    await isPast(page);
    await until('a button that saves', () => page.findByTestId('save-button').visible());
    await page.screenshot(`save-button-${viewport.width}.png`);
    await openSheet(page);
    await page.screenshot(`save-${viewport.width}.png`);
    expect(await violations(page)).toEqual([]);

    const table = await save(page, 'csv');
    expect(table.name).toMatch(/^demo_\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d\.csv$/);
    const [head = '', ...rows] = new TextDecoder().decode(table.bytes).trimEnd().split('\r\n');
    expect(head).toMatch(/^time,seconds,robot_time,ref\.WST \[rad\],/);
    expect(rows.length).toBeGreaterThan(100); // a busy machine sends fewer than 30 a second
    const count = head.split(',').length;
    expect(rows.filter((row) => row.split(',').length !== count)).toEqual([]);
    const times = rows.map((row) => Date.parse(row.split(',')[0]!));
    expect(times).toEqual([...times].sort((a, b) => a - b));

    const recorded = await save(page, 'posecast');
    expect(recorded.name).toMatch(/\.posecast$/);
    const files = unzipSync(recorded.bytes);
    const recording = decodeRecording(files['recording.json']!);
    expect(recording.robot).toBe('demo');
    for (const { take, index, frames } of recording.segments) {
      const { records } = decodeSegment(files[`segments/${take}/${index}.segment`]!);
      expect(records.filter(({ kind }) => kind === 'frame').length).toBe(frames);
    }
    const model = `models/${recording.models[0]}/`;
    const manifest = JSON.parse(new TextDecoder().decode(files[`${model}manifest.json`]));
    for (const { path: file, size } of manifest.files) expect(files[model + file]?.length, file).toBe(size);
    await page.screenshot(`saved-${viewport.width}.png`);
    // the same bytes at any size
    if (viewport === LAPTOP) await convertsToExports(relay, recorded.bytes, recording);
    await page.press('Escape');
    await until('no sheet', gone(page, 'save'));
  },
  240_000,
);

it('saves from one moment to another, says what is too much, and what can’t be had', async () => {
  const relay = await stage.stack.demo({ past: 'memory:' });
  const page = await lookBack(relay);
  await page.press('x');
  await until('the sheet', there(page, 'save'));
  await page.evaluate(`${testId('save-span-custom')}.click()`);
  const enterEnd = (end: string, ms: number) => {
    const local = new Date(ms - new Date(ms).getTimezoneOffset() * 60_000).toISOString().slice(0, 19);
    return enter(page, testId(`save-${end}`), local);
  };
  const measure = () => textOf(page, 'save-measure');
  const toMs = Math.floor(Date.now() / 1000) * 1000 - 8000;
  await enterEnd('to', toMs);
  await enterEnd('from', toMs - 3600_000);
  await until('too much', async () => /too much. A file holds at most ten minutes/.test(await measure()));
  await enterEnd('from', toMs + 5000);
  await until('nothing', async () => /an end after it/.test(await measure()));
  await enterEnd('from', toMs - 2000);
  await until('two seconds', async () => /:\d\d[1-7]?\d frames, about/.test(await measure()));
  await page.screenshot('save-custom.png');
  const { bytes } = await save(page, 'csv');
  const lines = new TextDecoder().decode(bytes).trimEnd().split('\r\n').length;
  expect(lines).toBeGreaterThan(1);
  expect(lines).toBeLessThan(75);

  // what is no longer available
  await relay.process.kill();
  await page.evaluate(`${testId('save-posecast')}.click()`);
  await until('measured', () => page.evaluate<boolean>(`${testId('save-go')}?.disabled === false`));
  await page.evaluate(`${testId('save-go')}.click()`);
  // segments fetched earlier are in the browser; not all of the model is
  const lacks = /lacks the model|does not answer/;
  await until('it says what it lacks', async () => lacks.test(await textOf(page, 'save-outcome')));
  page.forgive(/ERR_|WebSocket|Failed to load|NetworkError|CORS|access control/i);
}, 240_000);

it('has room for the sheet at every size, in both languages and themes', async (context) => {
  if (!FULL) context.skip('make test-full plays it');
  const relay = await stage.stack.demo({ past: 'memory:' });
  const page = await lookBack(relay);
  for (const [language, theme] of [
    ['en', 'dark'],
    ['ko', 'light'],
    ['en', 'light'],
    ['ko', 'dark'],
  ] as const) {
    await showIn(page, language, theme);
    await page.press('x');
    await until('the sheet', there(page, 'save'));
    await page.evaluate(`${testId('save-span-custom')}.click()`);
    for (const [width, height] of [
      [390, 844],
      [844, 390],
      [1440, 900],
      [1920, 1080],
    ] as const) {
      await page.viewport({ width, height });
      await until('measured', () => page.evaluate<boolean>(`${testId('save-go')}?.disabled === false`));
      await page.screenshot(`save-${language}-${theme}-${width}.png`);
      expect(await violations(page), `${language} ${theme} ${width}`).toEqual([]);
    }
    await page.press('Escape');
    await until('no sheet', gone(page, 'save'));
  }
}, 240_000);

/** Checks that `posecast convert` makes of a saved file what `past export` makes of that time on its relay. */
async function convertsToExports(relay: Relay, saved: Uint8Array, recording: PastRecording): Promise<void> {
  const folder = stage.stack.folder();
  const at = (name: string) => path.join(folder, name);
  writeFileSync(at('page.posecast'), saved);
  // a millisecond within, because the relay's next segment may begin at the end
  const ends = [recording.fromMs + 1, recording.toMs - 1].map((ms) => new Date(ms).toISOString());
  const span = ['--from', ends[0]!, '--to', ends[1]!];
  const command = (name: string, ...more: string[]) =>
    run(path.join(REPO, '.venv/bin', name), [...more, ...span], { cwd: folder });
  for (const format of ['mcap', 'csv']) {
    await command('posecast', 'convert', 'page.posecast', `page.${format}`);
    const from = ['--robot', 'demo', '--relay', relay.url];
    await command('posecast-relay', 'past', 'export', ...from, '-o', `relay.${format}`);
    const [ours, theirs] = [readFileSync(at(`page.${format}`)), readFileSync(at(`relay.${format}`))];
    expect(ours.length).toBeGreaterThan(100_000);
    expect(ours.equals(theirs), format).toBe(true);
  }
}
