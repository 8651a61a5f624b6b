import { readFileSync } from 'node:fs';
import { strToU8, zipSync } from 'fflate';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { exportPast } from './exported.ts';
import { isRecorded, LAPTOP, NEAR_MS, recorded, TOLD } from './recording_page.ts';
import { is, testId, textOf, there } from './robot_page.ts';
import { setStage } from './stage.ts';
import { shown } from './truth.ts';

/** In the light view, which draws often. */
const stage = setStage({ webgl: false });
const shared = stage.share(async (stack, newPage) => {
  const { relay, lecture } = await recorded(stack, 12);
  const file = await exportPast(stack, relay, 12, TOLD, 'lecture.posecast');
  const page = await newPage({ viewport: LAPTOP });
  page.forgive(/WebGL/);
  await page.open(`${relay.url}/#/`);
  return { relay, folder: lecture.at, file: file.at, page };
});

/** Puts files into an input as if a person had chosen them. */
const choose = (id: string, files: ReadonlyMap<string, Uint8Array>): string => `(() => {
  const chosen = new DataTransfer();
  for (const [name, text] of ${JSON.stringify([...files].map(([name, bytes]) => [name, Buffer.from(bytes).toString('base64')]))})
    chosen.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
  const input = ${testId(id)};
  input.files = chosen.files;
  input.dispatchEvent(new Event('change', { bubbles: true }));
})()`;

/** What is shown once the body stands as it did at its moment. */
const posed = (page: Page) =>
  until('the pose of its moment', async () => {
    const now = await shown(page);
    return now.momentMs !== null && now.offMs < NEAR_MS ? now : null;
  });

const isList = (page: Page) => until('the list', there(page, 'choose-zip'));

it('a .posecast file that is chosen is shown, and what is none says so in one sentence', async () => {
  const { file: lecture, page } = await shared();
  await isList(page);
  const bytes = readFileSync(lecture);
  const refusal = () => textOf(page, 'drop-refused');
  for (const [name, file, says] of [
    ['cut.posecast', bytes.subarray(0, bytes.length >> 1), /can’t be read/],
    ['empty.posecast', Buffer.from(zipOf({ 'x.txt': 'x' })), /file contains no recording/],
    ['newer.posecast', Buffer.from(zipOf({ 'recording.json': newer })), /newer Posecast/],
    ['odd.posecast', Buffer.from(zipOf({ 'recording.json': '{"format":' })), /recording\.json is damaged/],
    ['recording.json', Buffer.from('{}'), /whole folder/],
  ] as const) {
    await page.evaluate(choose('choose-zip', new Map([[name, file]])));
    await until(name, async () => says.test(await refusal()));
  }
  const before = page.requested.length;
  await page.evaluate(choose('choose-zip', new Map([['lecture.posecast', bytes]])));
  await isRecorded(page);
  const first = await posed(page);
  await page.press('Space');
  await until('it plays', async () => (await shown(page)).seq > first.seq + 10);
  const sent = page.requested.slice(before).filter((url) => !/\/assets\/|api\/v1\/robots$/.test(url));
  expect(sent, 'nothing of it is asked for elsewhere').toEqual([]);
  expect(await page.evaluate<string>('location.hash')).not.toMatch(/t=/);
  await page.findByRole('button', 'Close the recording').click();
  await isList(page);
}, 240_000);

it('a folder that is dropped is shown, on the page of a robot too', async (context) => {
  stage.needs(context, 'files');
  const { relay, folder, page } = await shared();
  await page.open(`${relay.url}/#/`);
  await isList(page);
  await page.dropFiles({ x: 400, y: 300 }, [folder]);
  await isRecorded(page);
  await posed(page);
  await page.open(`${relay.url}/#/r/demo`);
  await until('LIVE', is(page, 'LIVE'));
  await page.dropFiles({ x: 400, y: 300 }, [folder]);
  await isRecorded(page);
  await page.findByRole('button', 'Close the recording').click();
  await until('LIVE again', is(page, 'LIVE'));
}, 240_000);

const newer = '{"format": "posecast-recording", "version": 2}';

function zipOf(files: Readonly<Record<string, string>>): Uint8Array {
  return zipSync(Object.fromEntries(Object.entries(files).map(([name, text]) => [name, strToU8(text)])));
}
