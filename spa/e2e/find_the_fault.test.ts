import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { holds, KEEP_SAVED, liveness, newestSaved, testId, textOf, there } from './robot_page.ts';
import { REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';

/** Without WebGL: pictures come quickly, however busy the machine is. */
const stage = setStage({ webgl: false });
const TUTORIAL = readFileSync(path.join(REPO, 'docs/tutorials/find-the-fault.md'), 'utf8');
/** The fault occurs 40 s after the robot goes on air. */
const FAULT_MS = 120_000;
const momentOf = async (page: Page) =>
  /[?&]t=([\d:.TZ-]+)/.exec(await page.evaluate<string>('location.href'))?.[1];

/** The tutorial must contain what is done or seen here. */
function told(words: string): string {
  expect(TUTORIAL.replaceAll(/\s+/g, ' ')).toContain(words);
  return words;
}

async function press(page: Page, key: string): Promise<void> {
  told(`\`${key}\``);
  await page.press(key.length === 1 ? key.toLowerCase() : key);
}

async function shows(page: Page, word: string): Promise<void> {
  told(`**${word}**`);
  await until(word, async () => (await liveness(page)) === word);
}

it('the tutorial finds the fault, looks back at it, links to it and saves it', async (context) => {
  if (!FULL) context.skip('make test-full plays it');
  stage.needs(context, 'files');
  const relay = await stage.stack.demo({ past: 'memory:' });
  const page = await stage.open(`${relay.url}/#/r/demo`, {
    preload: KEEP_SAVED,
    viewport: { width: 1366, height: 768 },
  });
  await shows(page, 'LIVE');

  const alarm = new RegExp([told('Right knee is blocked'), told('Right knee is not where')].join('|'));
  await until('the alarm', async () => alarm.test(await textOf(page, 'fault-line')), FAULT_MS);
  const row = () => page.evaluate<string>("document.querySelector('tbody tr').textContent");
  await until('its row', async () => (await row()).startsWith(told('RKN')));
  await until('its flag', async () => (await row()).includes(told('jam')));
  await page.findByRole('button', alarm).click();
  await until('its card', async () => (await textOf(page, 'joint-card')).includes('right knee'));

  told("Press the fault's time in the card");
  const time = `${testId('joint-card')}?.querySelector('button time')`;
  await until('a past to go to', holds(page, `${time} != null`));
  await page.evaluate(`${time}.parentElement.click()`);
  await shows(page, 'PAST');
  await press(page, 'Space');
  await until('a moment in the address', async () => (await momentOf(page)) !== undefined);
  const before = await momentOf(page);
  await press(page, '.');
  await until('the next frame', async () => (await momentOf(page)) !== before);
  const moment = await momentOf(page);

  await press(page, 'S');
  await until('the link', async () => (await textOf(page, 'share')).includes(`t=${moment}`));
  const other = await stage.newPage();
  await other.open(await page.evaluate<string>('location.href'));
  await shows(other, 'PAST');
  expect(await momentOf(other)).toBe(moment);
  await other.close();
  await page.press('Escape');

  await press(page, 'X');
  await until('the sheet', there(page, 'save'));
  await page.evaluate(`${testId(`save-${told('**Posecast**').replaceAll('*', '').toLowerCase()}`)}.click()`);
  await until('measured', holds(page, `${testId('save-go')}?.disabled === false`));
  await page.evaluate(`${testId('save-go')}.click()`);
  await until('saved', async () => /^Saved: .*\.posecast/.test(await textOf(page, 'save-outcome')));
  const { bytes } = await newestSaved(page);
  const folder = mkdtempSync(path.join(tmpdir(), 'posecast-'));
  try {
    const file = path.join(folder, 'fault.posecast');
    writeFileSync(file, bytes);
    await page.press('Escape');
    await page.dropFiles({ x: 400, y: 300 }, [file]);
    await shows(page, 'RECORDED');
  } finally {
    rmSync(folder, { recursive: true });
  }
}, 400_000);
