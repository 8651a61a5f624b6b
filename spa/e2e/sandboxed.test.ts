import { expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { Gate } from './gate.ts';
import { Host } from './host.ts';
import { hasSkin, holds, is } from './robot_page.ts';
import { setStage } from './stage.ts';

const stage = setStage();

it('a frame without an origin shows the robot of another site', async () => {
  const relay = await stage.demo();
  const host = await Host.open(stage.stack.folder());
  try {
    host.instead.set(
      '/index.html',
      `<title>A wiki</title>
      <script>words = []; addEventListener('message', ({ data, origin }) => words.push(origin + ' ' + data.word))</script>
      <iframe sandbox="allow-scripts" src="${relay.url}/embed/demo?origin=${host.url}" width="800" height="500"></iframe>`,
    );
    host.instead.set('/favicon.ico', '');
    const page = await stage.newPage();
    page.allow(relay.host);
    await page.open(`${host.url}/`);
    await until('LIVE', holds(page, `words.includes('null LIVE')`));
    await until('the meshes', async () => page.requested.some((url) => /\/model\/.*\.glb/.test(url)));
    await page.screenshot('sandboxed-frame.png');
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
