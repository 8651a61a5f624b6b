import http from 'node:http';
import path from 'node:path';
import { expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { Host } from './host.ts';
import { chipText, is, RECORD, whole } from './robot_page.ts';
import { REPO } from './stack.ts';
import { FULL, setStage } from './stage.ts';
import { ClockRobot, WITNESS } from './truth.ts';

const stage = setStage();
const PRELOAD = { preload: `${RECORD};${WITNESS}` };

const isSocket = (url: string) => /^wss?:|\/live(\.sse)?\b/.test(url);

/** Sits in front of a relay like a cache, on another origin; records the requests and their headers. */
class Cache {
  readonly asked: { readonly url: string; readonly token: string | undefined }[] = [];
  readonly #server: http.Server;

  private constructor(server: http.Server) {
    this.#server = server;
  }

  static async open(relayUrl: string): Promise<Cache> {
    const server = http.createServer();
    const cache = new Cache(server);
    server.on('request', (request, response) => {
      const { url = '/', method, headers } = request;
      cache.asked.push({ url, token: headers.authorization });
      const { host: _, ...rest } = headers;
      const up = http.request(new URL(url, relayUrl), { method, headers: rest }, (answer) => {
        response.writeHead(answer.statusCode ?? 502, answer.headers);
        answer.pipe(response);
      });
      up.on('error', () => response.destroy());
      response.on('close', () => up.destroy());
      request.pipe(up);
    });
    await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
    return cache;
  }

  get host(): string {
    const address = this.#server.address();
    return `127.0.0.1:${address !== null && typeof address === 'object' ? address.port : 0}`;
  }

  get url(): string {
    return `http://${this.host}`;
  }

  async close(): Promise<void> {
    this.#server.closeAllConnections();
    await new Promise<void>((resolve) => this.#server.close(() => resolve()));
  }
}

it('reads by way of the lane that config.json names, and sends it no token', async () => {
  const relay = await stage.stack.relay({ past: 'memory:' });
  const robot = new ClockRobot(stage.stack, relay);
  const cache = await Cache.open(relay.url);
  const host = await Host.open(path.join(REPO, 'spa/dist'));
  try {
    host.instead.set('/config.json', JSON.stringify({ relay: relay.url, lane: cache.url }));
    const page = await stage.newPage(PRELOAD);
    page.allow(cache.host);
    await page.open(`${host.url}/#/r/demo`);
    await until('LIVE', is(page, 'LIVE'));
    await until('a body', () => whole(page));
    await until('behind', async () => / s behind$/.test(await chipText(page)));
    await page.findByTestId('liveness').click();
    const explained = () => page.findByTestId('liveness-explained').text();
    await until('why', async () => /any number of people can watch/.test(await explained()));
    await until('a past', () => cache.asked.some(({ url }) => /\/past\/public\/\d{4}-/.test(url)));
    expect(page.requested.filter(isSocket), 'nobody is asked for a socket').toEqual([]);
    expect(page.requested.filter((url) => url.startsWith(`${relay.url}/api/v1/robots/`))).toEqual([]);
    expect(cache.asked.some(({ url }) => url.endsWith('/manifest.json'))).toBe(true);
    expect(await robot.lies(page)).toEqual([]);

    // with a token (any, because this robot needs none), the page opens a socket
    page.allow(relay.host);
    const before = cache.asked.length;
    await page.open(`${host.url}/?again#/r/demo?t=L1.demo.1900000000.abcdefgh.signature`);
    page.forgive(/WebSocket|status of 40\d/);
    await until('a socket', () => page.requested.some(isSocket));
    expect(cache.asked.slice(before).filter(({ url }) => url.includes('/robots/demo/'))).toEqual([]);
    expect(cache.asked.filter(({ token }) => token !== undefined)).toEqual([]);
    expect(page.foreign).toEqual([]);
  } finally {
    await host.close();
    await cache.close();
  }
});

it.skipIf(!FULL)(
  'reads everything from the relay where nobody answers at the lane that config.json names',
  async () => {
    const relay = await stage.stack.relay({ past: 'memory:' });
    const robot = new ClockRobot(stage.stack, relay);
    const gone = await Cache.open(relay.url);
    const [goneUrl, goneHost] = [gone.url, gone.host];
    await gone.close(); // so that nobody listens there
    const host = await Host.open(path.join(REPO, 'spa/dist'));
    try {
      host.instead.set('/config.json', JSON.stringify({ relay: relay.url, lane: goneUrl }));
      const page = await stage.newPage(PRELOAD);
      page.allow(goneHost);
      page.allow(relay.host);
      page.forgive(/ERR_CONNECTION_REFUSED|NetworkError|Could not connect|Load failed/);
      await page.open(`${host.url}/#/r/demo`);
      await until('LIVE', is(page, 'LIVE'));
      await until('a body', () => whole(page));
      expect(await chipText(page)).not.toMatch(/behind/);
      const atRelay = (part: RegExp) =>
        page.requested.some((url) => url.startsWith(`${relay.url}/api/v1/robots/demo/`) && part.test(url));
      await until('a past', () => atRelay(/\/past\/public\/\d{4}-/));
      expect(atRelay(/\/manifest\.json$/)).toBe(true);
      expect(await robot.lies(page)).toEqual([]);
      expect(page.foreign).toEqual([]);
    } finally {
      await host.close();
    }
  },
);

it.skipIf(!FULL).each([['/'], ['/embed/demo']])(
  '%s?lane=segments reads in parts at the relay itself',
  async (at) => {
    const relay = await stage.stack.relay({ past: 'memory:' });
    const robot = new ClockRobot(stage.stack, relay);
    const page = await stage.open(`${relay.url}${at}?lane=segments#/r/demo`, PRELOAD);
    await until('LIVE', is(page, 'LIVE'));
    await until('a body', () => whole(page));
    await until('behind', async () => / s behind$/.test(await chipText(page)));
    expect(page.requested.filter(isSocket)).toEqual([]);
    expect(await robot.lies(page)).toEqual([]);
  },
);
