/** A robot about which there is as much to say as possible. */

import { cpSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import type { Page } from '../driver/page.ts';
import { until } from '../driver/until.ts';
import type { Process } from '../process.ts';
import { chipText, holds, there } from '../robot_page.ts';
import { DEMO, demoAt, type Moment } from '../sign_words.ts';
import type { Relay, Stack } from '../stack.ts';

/** The demo robot's model, with as many problems in its manifest as possible. */
function faultyModel(folder: string): string {
  cpSync(DEMO.model, folder, { recursive: true });
  const file = path.join(folder, 'manifest.json');
  const manifest = JSON.parse(readFileSync(file, 'utf8'));
  manifest.missing = ['Body_RWP', 'Body_Head', 'Body_LAR'].map((name) => ({
    uri: `package://demo/${name}.stl`,
    reason: 'not found',
  }));
  manifest.findings = [12, 48, 120].map((line) => ({
    ...{ severity: 'warning', line },
    text: "joint 'tilt' is revolute and has no <limit>: a viewer can't tell how far it may go",
  }));
  writeFileSync(file, JSON.stringify(manifest));
  return folder;
}

/** Light view: the same notes, and cheap pictures. */
const SETTINGS = { body: 'light', load: 'cur', shown: 'both' };
export const CHOSEN = `try { localStorage.setItem('posecast.settings', ${JSON.stringify(JSON.stringify(SETTINGS))}) } catch {}`;

/** A relay with a robot that sends more than its share and has a blocked knee, missing meshes and findings. */
export async function noticedRobot(
  stack: Stack,
): Promise<{ relay: Relay; source: Process; sample: Moment & { wave: object } }> {
  const relay = await stack.relay({ viewFrames: 7 }); // so that it exceeds its share
  const sample = { ...demoAt(42), wave: { pos: { RSP: [0.2, 0.2] } } } as unknown as Moment & {
    wave: object;
  };
  const model = faultyModel(path.join(stack.folder(), 'model'));
  const { source } = stack.fedEdge(relay, sample, { ...DEMO, model });
  return { relay, source, sample };
}

/** Opens its page, as anyone sees it, and waits for all that there is to say; two joints lose their reading meanwhile. The page needs
 *  the preload `CHOSEN`. */
export async function openNoticed(
  page: Page,
  { relay, source, sample }: Awaited<ReturnType<typeof noticedRobot>>,
): Promise<void> {
  const has = (id: string) => until(id, there(page, id));
  await page.open(`${relay.url}/?as=anyone#/r/demo`);
  for (const id of ['model-findings', 'model-note', 'load-legend', 'signs', 'as-anyone', 'level', 'filter'])
    await has(id);
  await has('acknowledge');
  await until('a joint', holds(page, 'document.querySelector("tr[data-label=WST]") !== null'));
  source.write(JSON.stringify({ ...sample, pos: { ...sample.pos, WST: null, NKY: null } }));
  await has('unread-note');
  await has('balance-line');
  await until('too much', async () => /too much/.test(await chipText(page)));
}
