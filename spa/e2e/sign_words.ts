/** Shared code for the tests of the overlay signs. */

import { execFileSync } from 'node:child_process';
import path from 'node:path';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { body } from './robot_page.ts';
import { PYTHON, REPO } from './stack.ts';

const EDGE = path.join(REPO, 'edge-agent/src/posecast_edge');
export const DEMO = {
  profile: path.join(EDGE, 'profiles/demo.toml'),
  model: path.join(EDGE, 'demo_bundle/model'),
};

/** The colour of a fault in either theme. */
export const FAULT = /^#(ff5d5d|c81e1e)$/;

interface Shown {
  readonly value: number | null;
  readonly level: string;
  readonly size: number;
}

export interface Signs {
  readonly wrenches: readonly { site: string; force: Shown | null; moment: Shown | null }[];
  readonly deviations: readonly { channel: string; error: number; compliant: boolean }[];
  readonly level: {
    planeZ: number | null;
    roll: number | null;
    pitch: number | null;
    feet: readonly string[];
  };
  readonly loads: Readonly<Record<string, string>>;
  readonly ghostLinks: readonly string[];
}

/** The demo robot's readings at a moment: field → label → value in the field's unit, null = no reading. */
export type Moment = Record<string, Record<string, number | null>>;

/** The demo robot's readings at each of these seconds of its motion. */
export function demoOver(seconds: readonly number[]): Moment[] {
  const args = [path.join(REPO, 'spa/e2e/demo_moment.py'), ...seconds.map(String)];
  const output = execFileSync(PYTHON, args, { maxBuffer: 1 << 26 });
  return output
    .toString()
    .trimEnd()
    .split('\n')
    .map((line) => JSON.parse(line) as Moment);
}

/** The demo robot's readings at a second of its motion. */
export function demoAt(second: number): Moment {
  return demoOver([second])[0]!;
}

export function signs(page: Page): Promise<Signs> {
  return page.evaluate<Signs>('JSON.parse(JSON.stringify(window.posecast.scene.signs))');
}

export function labels(page: Page): Promise<string[]> {
  return page.evaluate<string[]>(
    `[...document.querySelectorAll('.sign-label')].map((label) => label.dataset.sign + ': ' + label.textContent)`,
  );
}

export async function shown(page: Page): Promise<void> {
  await until('a body', async () => Object.keys((await body(page))?.links ?? {}).length > 0);
}

export async function choose(page: Page, settings: Record<string, unknown>): Promise<void> {
  await page.evaluate(`(() => {
    const key = 'posecast.settings';
    const kept = JSON.parse(localStorage.getItem(key) ?? '{}');
    localStorage.setItem(key, JSON.stringify({ ...kept, ...${JSON.stringify(settings)} }));
    // the address may contain the previous choice, which would win
    history.replaceState(null, '', location.hash.split('?')[0]);
    history.replaceState = () => {};
  })()`);
  page.forgive(/Importing a module script failed/); // WebKit's message about a request that the reload has cancelled
  await page.reload();
  await shown(page);
}
