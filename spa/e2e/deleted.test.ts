import { execFile } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { promisify } from 'node:util';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { holds, is } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

/** Without WebGL: pictures come quickly, however busy the machine is. */
const stage = setStage({ webgl: false });
const run = promisify(execFile);

const FINE = {
  flags: { RKN: ['homed', 'enabled'] },
  wave: { pos: { RKN: [0.4, 0.5] }, ref: { RKN: [0.4, 0.5] } },
};
const JAMMED = { ...FINE, flags: { RKN: ['homed', 'enabled', 'jam'] } };

const textOf = (page: Page, id: string) =>
  page.evaluate<string>(`document.querySelector('[data-testid="${id}"]')?.textContent ?? ''`);

/** The list of the last faults, opened, as soon as all are looked for. */
async function lastFaults(page: Page): Promise<string> {
  await page.press('g');
  const tab = 'document.querySelectorAll(".moment-ways input")[1]';
  await until('the sheet', holds(page, `${tab} !== undefined`));
  await page.evaluate(`${tab}.click()`);
  await until('all of them', async () =>
    /in what is kept|that are kept/.test(await textOf(page, 'incidents')),
  );
  const said = await textOf(page, 'incidents');
  await page.press('Escape');
  return said;
}

it('a stretch that was deleted leaves an open page, and does not come back with a reload', async () => {
  const robots = path.join(stage.stack.folder(), 'robots.toml');
  writeFileSync(robots, '[robots.demo]\nkeep = "1d"\n[robots.demo.anyone]\npast = "1d"\n', { mode: 0o600 });
  const past = `file://${stage.stack.folder()}`;
  const relay = await stage.stack.relay({ past, robots });
  const { source } = stage.stack.fedEdge(relay, FINE, { profile: 'demo' });
  const page = await stage.open(`${relay.url}/#/r/demo`, { viewport: { width: 1366, height: 768 } });
  await until('LIVE', is(page, 'LIVE'));
  source.write(JSON.stringify({ ...JAMMED, once: true }));
  await until('the fault', async () =>
    /^Earlier: Right knee is blocked/.test(await textOf(page, 'fault-line')),
  );
  const isMarked = 'document.querySelector(".track-mark[data-level=fault]") !== null';
  await until('its mark', holds(page, isMarked));
  expect(await lastFaults(page)).toContain('Right knee');
  await page.press('b');
  await until('PAST', is(page, 'PAST'));
  await page.press(' ');
  const momentMs = () => page.evaluate<number | null>('window.posecast.twin.moment_ms');
  await until('its moment', async () => (await momentMs()) !== null);
  const faultMs = (await momentMs())! + 2000;
  await until(
    'recorded beyond it',
    async () => ((await relay.json('/api/v1/robots/demo/past')) as { to_ms: number }).to_ms > faultMs + 2000,
  );

  const time = (atMs: number) => new Date(atMs).toISOString();
  const command = ['past', 'delete', '--yes', '--past', past, '--robot', 'demo'];
  const span = ['--from', time(faultMs - 60_000), '--to', time(faultMs + 2000)];
  await run(path.join(REPO, '.venv/bin/posecast-relay'), [...command, ...span]);
  await until('another moment', async () => ((await momentMs()) ?? 0) >= faultMs);
  expect(await page.evaluate<boolean>(isMarked)).toBe(false);
  expect(await lastFaults(page)).toContain('No faults in what is kept.');
  await page.press('e');
  await until('LIVE', is(page, 'LIVE'));
  await until('none of it', async () => (await textOf(page, 'fault-line')) === 'No faults');

  await page.open(`${relay.url}/?again#/r/demo?t=${time(faultMs)}`);
  await until('PAST', is(page, 'PAST'));
  await until('another moment', async () => ((await momentMs()) ?? 0) >= faultMs);
  expect(await lastFaults(page)).toContain('No faults in what is kept.');
}, 400_000);
