import { cpSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { Host } from './host.ts';
import { holds, is, liveness, SWINGING, there } from './robot_page.ts';
import { REPO } from './stack.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const PREFIX = '/~somebody/robots/';

/** Simulates a newer deployment: every script has a new name, and the old names are gone. */
function deploy(folder: string): void {
  const assets = path.join(folder, 'assets');
  const scripts = readdirSync(assets).filter((name) => name.endsWith('.js'));
  const newer = (text: string) =>
    text.replace(/[\w.-]+\.js\b/g, (name) => (scripts.includes(name) ? `newer-${name}` : name));
  for (const name of scripts) {
    writeFileSync(path.join(assets, newer(name)), newer(readFileSync(path.join(assets, name), 'utf8')));
    rmSync(path.join(assets, name));
  }
  const index = path.join(folder, 'index.html');
  writeFileSync(index, newer(readFileSync(index, 'utf8')));
}

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
  const isLive = (page: Page) => is(page, 'LIVE');

  it('reads the relay that config.json names, or one of those it allows, and no other', async () => {
    const [one, two] = [await stage.stack.relay(), await stage.stack.relay()];
    stage.stack.fedEdge(one, SWINGING, { robot: 'demo' });
    stage.stack.fedEdge(two, SWINGING, { robot: 'other' });
    config({ relay: one.url, relays: [two.url] });
    const page = await stage.newPage();
    page.allow(one.host);
    page.allow(two.host);
    page.forgive(/WebSocket|404/); // it tries its own origin while it waits for config.json
    await page.open(`${host.url}${PREFIX}#/r/demo`);
    await until('LIVE', isLive(page));

    await page.open(`${host.url}${PREFIX}?relay=${two.url}#/`);
    await until('the robot of the other', there(page, 'robot-other'));
    expect(await page.findByTestId('relay-host').text()).toContain(two.host);
    await page.findByTestId('robot-other').click();
    await until('LIVE', isLive(page));
    const allowed = await page.evaluate<string>(
      `fetch('${one.url}/api/v1/robots').then(() => 'came', () => 'refused')`,
    );
    expect(allowed, 'the browser itself asks nobody else').toBe('refused');
    page.forgive(/Content.Security.Policy|Refused to connect|held back by policy/); // the message differs by browser

    await page.open(`${host.url}${PREFIX}?relay=https://evil.example#/r/demo`);
    await until('refused', there(page, 'relay-refused'));
    expect(await page.findByTestId('relay-refused').text()).toContain('https://evil.example');
  });

  it('is loaded anew, once, when it asks for a part that a deploy has replaced', async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, SWINGING);
    config({ relay: relay.url });
    // with data saving on, nothing is prefetched
    const preload = `Object.defineProperty(navigator, 'connection', { value: { saveData: true } })`;
    const page = await stage.newPage({ preload });
    page.allow(relay.host);
    page.forgive(/WebSocket|404|not-here/);
    page.forgive(/dynamically imported module|Loading module from|Importing a module script failed/); // the message differs by browser
    await page.open(`${host.url}${PREFIX}#/r/demo`);
    await until('LIVE', isLive(page));
    // everything that loads automatically has loaded; later parts would trigger the reload as well
    await until('its filter', holds(page, 'document.querySelector(".filter") !== null'));
    await until('what is said aloud', there(page, 'spoken'));
    await page.findByTestId('liveness').click();
    await until('why', async () => (await page.findByTestId('liveness-explained').text()) !== '');
    await page.press('Escape');
    await page.evaluate('window.before = true');

    deploy(folder);
    const begun = () => page.requested.filter((url) => url.endsWith('/config.json')).length;
    const times = begun();
    await page.findByRole('button', 'Settings').click();
    await until('loaded anew', async () => begun() > times);
    await page.loaded();
    expect(await page.evaluate<boolean>('window.before === true')).toBe(false);
    await until('LIVE', isLive(page));
    await page.findByRole('button', 'Settings').click();
    await until('it is there', there(page, 'settings'));
    await page.press('Escape');

    const assets = path.join(folder, 'assets');
    rmSync(path.join(assets, readdirSync(assets).find((name) => /^newer-share-.*\.js$/.test(name)) ?? ''));
    await page.evaluate('window.before = true');
    await page.findByRole('button', 'Share').click();
    await until('said so', there(page, 'not-here'));
    expect(await page.evaluate<boolean>('window.before === true'), 'nothing to be had by loading anew').toBe(
      true,
    );
    expect(await liveness(page)).toBe('LIVE');
  });
});
