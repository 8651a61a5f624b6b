import { expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { Gate } from './gate.ts';
import { Host } from './host.ts';
import { hasSkin, holds, is } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

const ISOLATED = {
  'cross-origin-embedder-policy': 'require-corp',
  'cross-origin-opener-policy': 'same-origin',
};

it.each([
  { parent: 'a page that gives it no origin', attributes: 'sandbox="allow-scripts"', headers: {} },
  { parent: 'a page that is cross-origin isolated', attributes: '', headers: ISOLATED },
  {
    ...{ parent: 'a page that is isolated and gives it no origin', attributes: 'sandbox="allow-scripts"' },
    headers: ISOLATED,
  },
])('a frame shows the robot of another site in $parent', async ({ attributes, headers }) => {
  const relay = await stage.demo();
  const host = await Host.open(stage.stack.folder());
  host.headers = headers;
  try {
    host.instead.set(
      '/index.html',
      `<title>A wiki</title>
      <script>words = []; addEventListener('message', ({ data, origin }) => words.push(origin + ' ' + data.word))</script>
      <iframe ${attributes} src="${relay.url}/embed/demo?origin=${host.url}" width="800" height="500"></iframe>`,
    );
    host.instead.set('/favicon.ico', '');
    const page = await stage.newPage();
    page.allow(relay.host);
    await page.open(`${host.url}/`);
    expect(await page.evaluate<boolean>('crossOriginIsolated')).toBe(headers === ISOLATED);
    const origin = attributes === '' ? relay.url : 'null';
    await until('LIVE', holds(page, `words.includes('${origin} LIVE')`));
    await until('the meshes', async () => page.requested.some((url) => /\/model\/.*\.glb/.test(url)));
    await page.screenshot(`framed-${origin === 'null'}-${headers === ISOLATED}.png`);
  } finally {
    await host.close();
  }
});

/** As inside such a frame, into which a driver can't look. */
it('a page without an origin has its numbers and its body', async () => {
  const relay = await stage.demo();
  const gate = await Gate.open(relay.port);
  gate.documentHeaders = { 'content-security-policy': 'sandbox allow-scripts' };
  try {
    const page = await stage.open(`${gate.url}/embed/demo`);
    expect(await page.evaluate<string>('origin')).toBe('null');
    await until('LIVE', is(page, 'LIVE'));
    await until('its body', () => hasSkin(page));
    await page.screenshot('sandboxed-page.png');
  } finally {
    await gate.close();
  }
});
