import { cpSync, readdirSync, readFileSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { Host } from './host.ts';
import { liveness } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const PREFIX = '/~somebody/robots/';
const SWINGING = { pos: { RKN: 0 }, wave: { pos: { RKN: [0.4, 0.5] } } };

/** The built page as files in somebody's web space, under a path. */
describe('the page on a host of plain files', () => {
  let folder: string;
  let host: Host;
  beforeEach(async () => {
    folder = stage.stack.folder();
    cpSync(path.join(REPO, 'spa/dist'), folder, { recursive: true });
    host = await Host.open(folder, PREFIX);
  });
  afterEach(() => host.close());

  const config = (said: object) => host.instead.set(`${PREFIX}config.json`, JSON.stringify(said));
  const isLive = (page: Page) => async () => (await liveness(page)) === 'LIVE';

  it('reads the relay that config.json names, or one of those it allows, and no other', async () => {
    const [one, two] = [await stage.stack.relay(), await stage.stack.relay()];
    stage.stack.fedEdge(one, SWINGING, { robot: 'demo' });
    stage.stack.fedEdge(two, SWINGING, { robot: 'other' });
    config({ relay: one.url, relays: [two.url] });
    const page = await stage.newPage();
    page.allow(`127.0.0.1:${one.port}`);
    page.allow(`127.0.0.1:${two.port}`);
    page.forgive(/WebSocket|404/); // it tries its own origin while it asks what config.json says
    await page.open(`${host.url}${PREFIX}#/r/demo`);
    await until('LIVE', isLive(page), 30_000);

    await page.open(`${host.url}${PREFIX}?relay=${two.url}#/`);
    await until(
      'the robot of the other',
      async () => (await page.findByTestId('robot-other').count()) === 1,
      30_000,
    );
    expect(await page.findByTestId('relay-host').text()).toContain(`127.0.0.1:${two.port}`);
    await page.findByTestId('robot-other').click();
    await until('LIVE', isLive(page), 30_000);
    const allowed = await page.evaluate<string>(
      `fetch('${one.url}/api/v1/robots').then(() => 'came', () => 'refused')`,
    );
    expect(allowed, 'the browser itself asks nobody else').toBe('refused');
    page.forgive(/Content.Security.Policy|Refused to connect|held back by policy/); // as each browser has it

    await page.open(`${host.url}${PREFIX}?relay=https://evil.example#/r/demo`);
    await until('refused', async () => (await page.findByTestId('relay-refused').count()) === 1, 30_000);
    expect(await page.findByTestId('relay-refused').text()).toContain('https://evil.example');
  });

  it('is loaded anew, once, when it asks for a part that a deploy has replaced', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, SWINGING);
    config({ relay: relay.url });
    const page = await stage.newPage();
    page.allow(`127.0.0.1:${relay.port}`);
    page.forgive(/WebSocket|404|not-here/);
    page.forgive(/dynamically imported module|Loading module from|Importing a module script failed/); // as each browser has it
    await page.open(`${host.url}${PREFIX}#/r/demo`);
    await until('LIVE', isLive(page), 30_000);
    await page.evaluate('window.before = true');

    const assets = path.join(folder, 'assets');
    const rename = (pattern: RegExp): [was: string, is: string] => {
      const was = readdirSync(assets).find((name) => pattern.test(name)) ?? '';
      const is = was.replace(/-[\w-]{8}\./, '-deployed.');
      renameSync(path.join(assets, was), path.join(assets, is));
      return [was, is];
    };
    const put = (file: string, [was, is]: [string, string]) =>
      writeFileSync(file, readFileSync(file, 'utf8').replaceAll(was, is));
    const sheet = rename(/^SettingsSheet-.*\.js$/);
    const index = rename(/^index-.*\.js$/);
    for (const name of readdirSync(assets).filter((name) => name.endsWith('.js'))) {
      put(path.join(assets, name), sheet);
      put(path.join(assets, name), index);
    }
    put(path.join(folder, 'index.html'), index);

    await page.findByRole('button', 'Settings').click();
    await until('loaded anew', async () => !(await page.evaluate<boolean>('window.before === true')), 30_000);
    await until('LIVE', isLive(page), 30_000);
    await page.findByRole('button', 'Settings').click();
    await until('it is there', async () => (await page.findByTestId('settings').count()) === 1);
    await page.press('Escape');

    rmSync(path.join(assets, readdirSync(assets).find((name) => /^ShareSheet-.*\.js$/.test(name)) ?? ''));
    await page.evaluate('window.before = true');
    await page.findByRole('button', 'Share').click();
    await until('said so', async () => (await page.findByTestId('not-here').count()) === 1);
    expect(await page.evaluate<boolean>('window.before === true'), 'nothing to be had by loading anew').toBe(
      true,
    );
    expect(await liveness(page)).toBe('LIVE');
  });
});
