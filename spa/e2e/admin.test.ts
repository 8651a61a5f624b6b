/** The operator's admin page, with a real relay and its robots file. */

import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { violations } from './axe.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { holds } from './robot_page.ts';
import { REPO, type Relay } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();
const KOREAN = 'Object.defineProperty(navigator, "language", { get: () => "ko-KR" })';

interface Lab {
  readonly relay: Relay;
  readonly secret: string;
  readonly robots: (...words: readonly string[]) => string;
}

/** A relay with two robots in its file, one of them on air. */
const startLab = stage.share(async (stack): Promise<Lab> => {
  const file = path.join(stack.folder(), 'robots.toml');
  const robots = (...words: readonly string[]) =>
    execFileSync(path.join(REPO, '.venv/bin/posecast-relay'), ['robots', ...words, '--robots', file], {
      encoding: 'utf8',
      stdio: ['ignore', 'pipe', 'ignore'],
    });
  robots('add', 'demo');
  robots('set', 'demo', '--anyone', 'nothing', '--link', 'view=public');
  robots('add', 'arm-in-the-other-hall-behind-the-blue-door', '--private', '--days', '30');
  const secret = robots('admin').trim();
  const relay = await stack.relay({ robots: file });
  stack.edge(relay);
  return { relay, secret, robots };
});

const run = (page: Page, script: string) => page.evaluate<string>(script);
const act = (page: Page, statement: string) => page.evaluate(`(() => { ${statement}; return null; })()`);
const says = (page: Page, words: string) => async () => (await page.text()).includes(words);

async function open(page: Page, lab: Lab, secret = lab.secret): Promise<void> {
  await page.open(`${lab.relay.url}/admin`);
  await until('the door', holds(page, 'document.activeElement?.id === "credential"'));
  await act(page, `document.getElementById('credential').value = ${JSON.stringify(secret)}`);
  await page.press('Enter');
}

const button = (robot: string, n: number) =>
  `document.querySelector('li[data-robot="${robot}"]').querySelectorAll('.line > button')[${n}]`;

describe('the page /admin', () => {
  it('shows robots and figures, makes and revokes share links, and keeps its credential nowhere', async () => {
    const lab = await startLab();
    const page = await stage.newPage();
    page.forgive(/401/);
    await open(page, lab, 'x'.repeat(43));
    await until('it is refused', says(page, 'Wrong credential.'));
    await open(page, lab);
    await until('the robot is on air', says(page, 'online'));
    const told = await page.text();
    for (const words of [
      'ready',
      'Skipped frames',
      'public (no past)',
      'nobody',
      'posecast-relay robots set arm-in-the-other-hall-behind-the-blue-door --link view=public',
      'Past in memory',
    ])
      expect(told).toContain(words);

    await act(page, `${button('demo', 0)}.click()`);
    const address = `document.querySelector('li[data-robot="demo"] input').value`;
    await until('a link', async () => (await run(page, address)) !== '');
    const link = await run(page, address);
    expect(await page.text()).toContain('start the relay with --public-url');
    await act(page, `document.querySelector('li[data-robot="demo"] input').focus()`);
    const asked = () =>
      page.evaluate<number>(
        'performance.getEntriesByType("resource").filter((each) => each.name.endsWith("/api/v1/admin")).length',
      );
    const before = await asked();
    await until('it has asked twice more', async () => (await asked()) >= before + 2);
    expect(await run(page, 'document.activeElement.value'), 'the focus stays').toBe(link);
    expect(link.startsWith(`${lab.relay.url}/#/r/demo?t=`)).toBe(true);
    const authorization = `Bearer ${link.split('?t=')[1]}`;
    const see = async () =>
      (await fetch(`${lab.relay.url}/api/v1/robots/demo/state`, { headers: { authorization } })).status;
    await until('it is good', async () => (await see()) === 200);

    await until('it may be revoked', holds(page, `!${button('demo', 1)}.hidden`));
    await act(page, `${button('demo', 1)}.click()`);
    expect(await run(page, `${button('demo', 1)}.textContent`)).toBe('Really revoke all?');
    expect(await see(), 'one click is not enough').toBe(200);
    await act(page, `${button('demo', 1)}.click()`);
    await until('it is good no more', async () => (await see()) === 401);
    expect(await page.text()).toContain('All share links of this robot are revoked.');

    lab.robots('set', 'demo', '--link', 'view=staff');
    const unsent = 'Link holders see: staff. The robot does not send this view. It sends: ';
    await until('a view that is not sent is named', says(page, unsent));

    const kept = await run(
      page,
      'JSON.stringify([document.cookie, {...localStorage}, {...sessionStorage}, location.href])',
    );
    expect(kept).not.toContain(lab.secret);
    expect(await run(page, 'document.cookie')).toBe('');
    expect(await run(page, 'document.documentElement.outerHTML')).not.toContain(lab.secret);
    await page.reload();
    await until('it asks again', holds(page, '!document.getElementById("door").hidden'));
    expect(await page.text()).not.toContain('online');
    await open(page, lab);
    await until('open', says(page, 'online'));
    await act(page, `document.getElementById('lock').click()`);
    expect(await page.text()).not.toContain('online');
  });

  it('can be read and used on a phone, in both themes, and in Korean', async () => {
    const lab = await startLab();
    for (const [name, viewport, scheme, preload, word] of [
      ['phone_dark', { width: 360, height: 740 }, 'dark', '', 'Robots'],
      ['phone_korean', { width: 360, height: 740 }, 'light', KOREAN, '로봇'],
      ['laptop_light', { width: 1280, height: 800 }, 'light', '', 'Robots'],
    ] as const) {
      const page = await stage.open(`${lab.relay.url}/admin`, { viewport, media: { scheme }, preload });
      await until('the door', holds(page, 'document.activeElement?.id === "credential"'));
      expect(await violations(page), `${name}: the door`).toEqual([]);
      await open(page, lab);
      await until(name, says(page, word));
      await act(page, `${button('demo', 0)}.click()`);
      await until('a link', holds(page, `!document.querySelector('li[data-robot="demo"] input').hidden`));
      expect(
        await page.evaluate('document.documentElement.scrollWidth <= innerWidth'),
        `${name}: nothing is cut`,
      ).toBe(true);
      const low = `[...document.querySelectorAll('button, input')].filter((each) => each.offsetParent !== null && each.offsetHeight < 44).length`;
      expect(await page.evaluate(low), `${name}: for fingers`).toBe(0);
      expect(await violations(page), name).toEqual([]);
      await page.screenshot(`admin_${name}.png`);
    }
  });

  it('says all in both languages', () => {
    const script = readFileSync(path.join(REPO, 'relay/src/posecast_relay/http/admin/page/admin.js'), 'utf8');
    const [english, korean] = ['ENGLISH', 'KOREAN'].map((name) => {
      const found = new RegExp(`const ${name} = \\{\\n([\\s\\S]*?)\\n\\};`).exec(script)?.[1] ?? '';
      return [...found.matchAll(/^ {2}(\w+):/gm)].map((each) => each[1]);
    });
    expect(english?.length).toBeGreaterThan(20);
    expect(korean).toEqual(english);
  });
});
