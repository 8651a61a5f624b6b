import { cpSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import { expect, it } from 'vitest';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { Host } from './host.ts';
import { is, SWINGING, there } from './robot_page.ts';
import { PYTHON, REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const PROJECT = 'demo-posecast';
const [EMAIL, PASSWORD] = ['student@example.org', 'open-sesame'];

const loaded = (page: Page) => page.requested.filter((url) => /\/assets\/account-[\w-]+\.js/.test(url));

/** On a laptop and on a phone, in e2e/shots. */
async function photograph(page: Page, name: string): Promise<void> {
  for (const [screen, viewport] of Object.entries({
    phone: { width: 390, height: 844 },
    laptop: { width: 1280, height: 800 },
  })) {
    await page.viewport(viewport);
    await page.screenshot(`${name}-${screen}.png`);
  }
}

async function fill(page: Page, email: string, password: string): Promise<void> {
  for (const [id, text] of [
    ['email', email],
    ['password', password],
  ] as const) {
    await page.evaluate(`document.querySelector('[data-testid="${id}"]').value = ''`);
    await page.findByTestId(id).type(text);
  }
  await page.findByTestId('sign-in-go').click();
}

/** Uses Google's own emulator, which is installed for `make test-full`. */
it.skipIf(!FULL)(
  'signs in, sees what is for those who are, comes back signed in, and signs out',
  async (context) => {
    const emulator = stage.stack.start('emulator', PYTHON, ['-m', 'tests.firebase.auth_emulator'], {
      env: { PYTHONPATH: REPO },
    });
    const [said = ''] = await emulator.line(/http:\/\/127\.0\.0\.1:\d+|not here: .*/, 600_000);
    if (said.startsWith('not here')) context.skip(said);
    const body = JSON.stringify({ email: EMAIL, password: PASSWORD });
    const headers = { 'content-type': 'application/json' };
    await fetch(`${said}/identitytoolkit.googleapis.com/v1/accounts:signUp?key=x`, {
      method: 'POST',
      headers,
      body,
    });

    const folder = stage.stack.folder();
    cpSync(path.join(REPO, 'spa/dist'), folder, { recursive: true });
    const host = await Host.open(folder);
    try {
      const robots = path.join(stage.stack.folder(), 'robots.toml');
      writeFileSync(robots, '[robots.open.anyone]\n[robots.lab.signed-in]\n', { mode: 0o600 });
      const emulatorHost = new URL(said).host;
      const accounts = { project: PROJECT, emulator: emulatorHost };
      const relay = await stage.stack.relay({ robots, accounts, origins: host.url });
      for (const robot of ['open', 'lab']) stage.stack.fedEdge(relay, SWINGING, { robot });
      const firebase = { apiKey: 'none', projectId: PROJECT, authDomain: 'x.example', emulator: said };
      host.instead.set('/config.json', JSON.stringify({ relay: relay.url, firebase }));
      const page = await stage.newPage();
      page.allow(new URL(relay.url).host);
      page.allow(emulatorHost);
      page.forgive(/status of 40\d|WebSocket/); // a wrong password; its own origin before config.json has loaded

      await page.open(`${host.url}/#/`);
      await until('the open robot', there(page, 'robot-open'));
      expect(await page.findByTestId('robot-lab').count()).toBe(0);
      await photograph(page, 'sign-in-list');
      expect(loaded(page), 'nothing of Firebase before somebody signs in').toEqual([]);
      await page.findByTestId('sign-in').click();
      await until('the dialog', there(page, 'email'));
      await photograph(page, 'sign-in');
      await fill(page, EMAIL, 'wrong');
      await until('it says so', there(page, 'sign-in-wrong'));
      await photograph(page, 'sign-in-wrong');
      expect(await page.findByTestId('sign-in-wrong').text()).toMatch(/Wrong e-mail or password/);
      await fill(page, EMAIL, PASSWORD);
      await until('the private robot', there(page, 'robot-lab'));

      await page.findByTestId('robot-lab').click();
      await until('LIVE', is(page, 'LIVE'));
      await page.evaluate(`window.dispatchEvent(new Event('online'))`);
      const renewed = () => page.requested.some((url) => url.includes('securetoken.googleapis.com'));
      await until('a newer token', async () => renewed());
      await page.reload();
      await until('LIVE again', is(page, 'LIVE'));
      expect(
        page.requested.filter((url) => /token=|eyJ/.test(url)),
        'no token in an address',
      ).toEqual([]);

      await page.findByRole('button', 'Settings').click();
      await until('the account', there(page, 'sign-in'));
      expect(await page.findByTestId('sign-in').text()).toBe(EMAIL);
      await photograph(page, 'sign-in-settings');
      await page.findByTestId('sign-in').click();
      await until('the way out', there(page, 'sign-out'));
      await photograph(page, 'sign-out');
      await page.findByTestId('sign-out').click();
      await until('not shared', async () => /not shared with you/.test(await page.text()));

      const other = await stage.newPage();
      other.allow(new URL(relay.url).host);
      other.allow(emulatorHost);
      other.forgive(/status of 40\d|WebSocket/);
      await other.open(`${host.url}/#/r/lab`);
      await until('asked to sign in', there(other, 'sign-in'));
      await photograph(other, 'sign-in-asked');
      await other.findByTestId('sign-in').click();
      await until('the dialog', there(other, 'email'));
      await fill(other, EMAIL, PASSWORD);
      await until('LIVE there', is(other, 'LIVE'));
    } finally {
      await host.close();
    }
  },
  900_000,
);
