/** Robots side by side, in a browser without 3D. */

import { setTimeout as pause } from 'node:timers/promises';
import { expect, it } from 'vitest';
import { engineName } from './driver/engines.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { renderedFrames, resting } from './robot_page.ts';
import { DEMO, demoAt } from './sign_words.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage({ webgl: false });

const SIX = ['one', 'two', 'three', 'four', 'five', 'six'];

const chip = (page: Page, robot: string) =>
  page.evaluate<string>(
    `document.querySelector('[data-testid="line-${robot}"] [data-testid=liveness]')?.dataset.state ?? ''`,
  );
/** The position of a robot's name, CSS px; null while it has no body. */
const nameAt = (page: Page, robot: string) =>
  page.evaluate<number | null>(`(() => {
    const label = document.querySelector('[data-testid="line-${robot}"]');
    return label?.style.visibility === 'visible' ? label.getBoundingClientRect().x : null;
  })()`);
const triangles = (page: Page) => page.evaluate<number>('window.posecast?.scene?.triangles ?? 0');

it.skipIf(!FULL)(
  'six stand side by side in the light view, each with its shells, its signs and its own truth',
  async () => {
    const relay = await stage.stack.relay();
    const jammed = demoAt(42);
    const sources = SIX.map(
      (robot, i) => stage.stack.fedEdge(relay, i === 2 ? jammed : demoAt(38), { ...DEMO, robot }).source,
    );
    const page = await stage.newPage({ viewport: { width: 1280, height: 800 } });
    page.forgive(/WebGL/);
    await page.open(`${relay.url}/#/r/${SIX.join('+')}`);
    await until('it says so', async () => /no 3D.*light view/i.test(await page.text()));
    for (const robot of SIX) {
      await until(`${robot} has a body`, async () => (await nameAt(page, robot)) !== null);
      await until(`${robot} holds`, async () => (await chip(page, robot)) === 'HOLDING');
    }
    await until('six with shells', async () => (await triangles(page)) > SIX.length * 5000);
    const places = await Promise.all(SIX.map((robot) => nameAt(page, robot)));
    expect(places, 'from left to right').toEqual(places.toSorted((a, b) => (a ?? 0) - (b ?? 0)));
    expect(new Set(places).size).toBe(SIX.length);

    const signs = (i: number) =>
      page.evaluate<{ wrenches: unknown[]; ghostLinks: string[] }>(
        `JSON.parse(JSON.stringify(window.posecast.scene.signsOf(window.posecast.scene.robots[${i}])))`,
      );
    await until('a ghost of the jammed one alone', async () => (await signs(2)).ghostLinks.length > 0);
    expect((await signs(0)).ghostLinks).toEqual([]);
    expect((await signs(0)).wrenches).toHaveLength(4);
    await until('three seconds of unchanged robots without a picture', async () => {
      const drawn = await renderedFrames(page);
      await pause(3000);
      return (await renderedFrames(page)) === drawn;
    });

    sources[1]!.signal('SIGSTOP');
    await until('one is STALE', async () => (await chip(page, 'two')) === 'STALE');
    await until('the others hold', async () => (await chip(page, 'one')) === 'HOLDING');
    await until('its colours have drained', () => resting(page));
    await page.screenshot(`light-line-${engineName()}.png`);

    const before = await renderedFrames(page);
    sources[0]!.write(JSON.stringify({ ...jammed, wave: { pos: { RSP: [0.5, 0.5] } } }));
    await until('one moves', async () => (await renderedFrames(page)) > before + 3);
    await page.viewport({ width: 390, height: 844 });
    const inside = (robot: string) =>
      page.evaluate<boolean>(`(() => {
      const { left, right } = document.querySelector('[data-testid="line-${robot}"]').getBoundingClientRect();
      return (left + right) / 2 >= 0 && (left + right) / 2 <= innerWidth;
    })()`);
    await until('all of them on a phone', async () => (await inside('one')) && (await inside('six')));
  },
  200_000,
);
