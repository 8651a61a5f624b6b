import { chmodSync, renameSync, writeFileSync } from 'node:fs';
import net from 'node:net';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import { en } from '../src/app/text/en.ts';
import type { Page } from './driver/page.ts';
import { until } from './driver/until.ts';
import { chipText, holds, is, SWINGING, there } from './robot_page.ts';
import { FULL, setStage } from './stage.ts';

const stage = setStage();

const text = (page: Page, selector: string) =>
  page.evaluate<string>(`document.querySelector(${JSON.stringify(selector)})?.textContent ?? ''`);
const note = (page: Page) => text(page, '[data-testid=stage-note]');

function profile(toml: string): string {
  const file = path.join(stage.stack.folder(), 'robot.toml');
  writeFileSync(file, toml);
  return file;
}

describe.skipIf(!FULL)('an address', () => {
  it('of a robot that is not there says so, and goes on when it comes', async () => {
    const relay = await stage.stack.relay();
    const page = await stage.open(`${relay.url}/#/r/nobody`);
    await until('OFFLINE', is(page, 'OFFLINE'));
    await until('said so', async () => (await note(page)).startsWith('This robot is not on air.'));
    stage.stack.fedEdge(relay, SWINGING, { robot: 'nobody' });
    await until('LIVE', is(page, 'LIVE'));
    expect(await note(page)).toBe('');
  });

  it('of a robot in a blackout says so, and goes on by itself when that ends, or when the robot is added', async () => {
    const robots = path.join(stage.stack.folder(), 'robots.toml');
    const allow = (toml: string) => {
      writeFileSync(`${robots}.new`, toml, { mode: 0o600 });
      renameSync(`${robots}.new`, robots);
    };
    allow('[robots.hubo.anyone]\n');
    const relay = await stage.stack.relay({ robots });
    stage.stack.fedEdge(relay, SWINGING, { robot: 'hubo' });
    stage.stack.fedEdge(relay, SWINGING, { robot: 'added' });
    const page = await stage.newPage();
    const early = await stage.newPage();
    await page.open(`${relay.url}/#/r/hubo`);
    await early.open(`${relay.url}/#/r/added`);
    await until('LIVE', is(page, 'LIVE'));
    allow('[robots.hubo.anyone]\nblackout = true\n');
    for (const each of [page, early])
      await until('said so', async () => (await note(each)).startsWith(en.endedAbsent));
    expect(await note(page)).toMatch(/Trying again in \d+ s/);
    allow('[robots.hubo.anyone]\n[robots.added.anyone]\n');
    for (const each of [page, early]) await until('LIVE', is(each, 'LIVE'));
  });

  it.each(['#/r/No%20Such%20Name', '#/r/', '#/x', '#/r/%00', '#/<img src=x onerror="window.bitten=true">'])(
    'that names nothing says so and leads to the list: %s',
    async (hash) => {
      const relay = await stage.stack.relay();
      const page = await stage.open(`${relay.url}/${hash}`);
      await until('said so', async () => (await text(page, '.broken')).includes('Nothing here'));
      expect(await page.evaluate<boolean>('window.bitten === undefined')).toBe(true);
      await page.findByRole('link', 'All robots').click();
      await until('the list', there(page, 'no-robots'));
    },
  );
});

describe.skipIf(!FULL)('a robot', () => {
  it('that comes back under another name is OFFLINE under the old one, and in the list under the new', async () => {
    const relay = await stage.stack.relay();
    const first = stage.stack.fedEdge(relay, SWINGING, { robot: 'old' });
    const page = await stage.open(`${relay.url}/#/r/old`);
    await until('LIVE', is(page, 'LIVE'));
    await first.edge.stop();
    stage.stack.fedEdge(relay, SWINGING, { robot: 'new' });
    await until('OFFLINE', is(page, 'OFFLINE'));
    expect(await chipText(page)).toMatch(/OFFLINE ?since \d\d:\d\d/);
    await until('said so', async () => (await note(page)).startsWith('Offline since'));
    expect(await text(page, 'td[data-field=pos]'), 'its last pose is still to be read').toMatch(/\d/);
    await page.findByRole('link', 'All robots').click();
    await until('the new name', there(page, 'robot-new'));
    await page.findByTestId('robot-new').click();
    await until('LIVE', is(page, 'LIVE'));
  });

  it('that is called otherwise from now on is called so at once, without a reload', async () => {
    const named = (name: string) =>
      profile(`[robot]\nname = "${name}"\n[labels]\njoint = ["RKN", "LKN"]\n[[fields]]\nname = "pos"\n`);
    const relay = await stage.stack.relay();
    const first = stage.stack.fedEdge(relay, SWINGING, { profile: named('Anna') });
    const page = await stage.open(`${relay.url}/#/r/demo`);
    await until('its name', async () => (await text(page, '.robot-name')) === 'Anna');
    await page.evaluate('window.born = true');
    await first.edge.stop();
    stage.stack.fedEdge(relay, SWINGING, { profile: named('Berta') });
    await until('its new name', async () => (await text(page, '.robot-name')) === 'Berta');
    await until('LIVE', is(page, 'LIVE'));
    expect(await page.evaluate<boolean>('window.born')).toBe(true);
  });

  it('may be called whatever one likes: list, title, card, share sheet and frame show it as text', async () => {
    const bite = '<img src=x onerror="window.bitten=true">';
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, SWINGING, {
      profile: profile(
        [
          '[robot]',
          `name = '${bite} & "quotes" ${'x'.repeat(80)}'`,
          '[labels]\njoint = ["RKN", "LKN"]\n[[fields]]\nname = "pos"',
          `[names]\nRKN = '${bite}'`,
        ].join('\n'),
      ),
    });
    const page = await stage.newPage({ viewport: { width: 390, height: 844 } });
    const whole = async (where: string) => {
      expect(
        await page.evaluate<boolean>('document.querySelector("img[src=x]") === null && !window.bitten'),
        where,
      ).toBe(true);
      const wide = await page.evaluate<number>('document.documentElement.scrollWidth - window.innerWidth');
      expect(wide, `nothing sticks out: ${where}`).toBeLessThanOrEqual(0);
    };
    await page.open(`${relay.url}/#/`);
    await until('its name', async () => (await text(page, '.card-name')).startsWith(bite));
    await whole('list');
    await page.findByTestId('robot-demo').click();
    await until('LIVE', is(page, 'LIVE'));
    expect(await text(page, '.robot-name')).toContain(bite);
    await page.findByRole('button', /^RKN$/).click();
    await until('its plain name', async () =>
      (await text(page, '[data-testid=joint-card] header')).includes(bite),
    );
    await whole('page');
    await page.press('Escape');
    await page.press('s');
    await until('the sheet', there(page, 'share'));
    const frame = await page.evaluate<string>(
      `[...document.querySelectorAll('[data-testid=share] code')].at(-1).textContent`,
    );
    expect(frame).toMatch(
      /^<iframe src="[^"<>]*" title="[^"<>]*" style="[^"<>]*" allow="fullscreen" loading="lazy"><\/iframe>$/,
    );
    await whole('share sheet');
    await page.open(`${relay.url}/embed/#/r/demo`);
    await until('its name', async () => (await text(page, '.embed-name')).startsWith(bite));
    await whole('frame');
  });
});

/** A relay from the future: every hello announces another wire format. */
async function newerRelay(port: number): Promise<{ url: string; close: () => void }> {
  const sockets = new Set<net.Socket>();
  const server = net.createServer((browser) => {
    const relay = net.connect({ port, host: '127.0.0.1' });
    for (const socket of [browser, relay]) {
      sockets.add(socket);
      socket.on('error', () => socket.destroy());
      socket.on('close', () => {
        sockets.delete(socket);
        browser.destroy();
        relay.destroy();
      });
    }
    browser.pipe(relay);
    // same length, so that its WebSocket frame still fits
    relay.on('data', (bytes) =>
      browser.write(bytes.toString('latin1').replace(/("wire": ?)1,/, '$19,'), 'latin1'),
    );
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  const { port: own } = server.address() as net.AddressInfo;
  return {
    url: `http://127.0.0.1:${own}`,
    close: () => {
      server.close();
      for (const socket of sockets) socket.destroy();
    },
  };
}

it.skipIf(!FULL)(
  'a relay newer than the page: it says so, asks to be loaded anew, and shows what it understands',
  async () => {
    const relay = await stage.stack.relay();
    stage.stack.fedEdge(relay, SWINGING);
    const newer = await newerRelay(relay.port);
    try {
      const page = await stage.open(`${newer.url}/#/r/demo`);
      await until('said so', async () => /newer protocol than this page/.test(await note(page)));
      await until('LIVE', is(page, 'LIVE'));
      expect(await note(page), 'it stays said').toMatch(/Reload/);
    } finally {
      newer.close();
    }
  },
);

it.skipIf(!FULL)('a fault of 30 ms reaches a viewer who may have one pose a second', async () => {
  const file = path.join(stage.stack.folder(), 'robots.toml');
  writeFileSync(file, '[robots.demo.anyone]\nview = "public"\nhz = 1\n');
  chmodSync(file, 0o600);
  const fine = { ...SWINGING, flags: { RKN: ['homed', 'enabled'] } };
  const relay = await stage.stack.relay({ robots: file });
  const { source } = stage.stack.fedEdge(relay, fine, { profile: 'demo' });
  const page = await stage.open(`${relay.url}/#/r/demo`);
  await until('LIVE', is(page, 'LIVE'));
  await until('one pose a second', holds(page, 'window.posecast.link.granted_hz === 1'));
  const line = () => text(page, '[data-testid=fault-line]');
  await until('no faults', async () => (await line()) === 'No faults');
  for (let n = 0; n < 3; n += 1) {
    source.write(JSON.stringify({ ...fine, flags: { RKN: ['homed', 'enabled', 'jam'] }, once: true }));
    await until('latched', async () =>
      /^Earlier: Right knee is blocked\.RKN · jam · ended/.test(await line()),
    );
    await page.findByTestId('acknowledge').click();
    await until('acknowledged', async () => (await line()) === 'No faults');
  }
});
