import { readdirSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { chipWords, stageWords } from '../../src/app/words/status.ts';
import { request, SignInNeeded, signInNeeded } from '../../src/relay/request.ts';
import { StreamClient } from '../../src/stream/client.ts';
import { RobotTwin } from '../../src/twin/robot.ts';

const OWN = 'https://robots.example';
const API = `${OWN}/api/v1/robots`;
const html = { 'content-type': 'text/html; charset=utf-8' };
const json = { 'content-type': 'application/json' };
const MOVED = { type: 'opaqueredirect', status: 0, headers: new Headers() } as Response;

/** What was asked: the address, and what of the request matters here. */
let asked: { url: string; init: RequestInit }[] = [];

class FakeWorker {
  static last: FakeWorker | null = null;
  onmessage: ((event: { data: unknown }) => void) | null = null;
  constructor() {
    FakeWorker.last = this;
  }
  postMessage(): void {}
}

function answerWith(answer: Response | Error): void {
  vi.stubGlobal('fetch', async (url: string, init: RequestInit = {}) => {
    asked.push({ url, init });
    if (answer instanceof Error) throw answer;
    return answer;
  });
}

beforeEach(() => {
  asked = [];
  signInNeeded.set(false);
  vi.stubGlobal('location', { origin: OWN });
});
afterEach(() => vi.unstubAllGlobals());

describe('a proxy that people sign in to', () => {
  it.each<[string, Response]>([
    [
      'asks for a password',
      new Response('', { status: 401, headers: { 'www-authenticate': 'Basic realm="lab"' } }),
    ],
    ['refuses in JSON', new Response('{}', { status: 401, headers: json })],
    [
      'names a realm of its own',
      new Response('', { status: 401, headers: { 'www-authenticate': 'Bearer realm="x"' } }),
    ],
    ['answers with its page', new Response('<form>', { status: 403, headers: html })],
    ['answers with its page as if that were the data', new Response('<form>', { headers: html })],
    ['leads to another address', MOVED],
  ])('%s', async (_, answer) => {
    answerWith(answer);
    await expect(request(API)).rejects.toThrow(SignInNeeded);
    expect(signInNeeded.get()).toBe(true);
    answerWith(new Response('{}', { headers: json }));
    await request(API);
    expect(signInNeeded.get(), 'signed in again').toBe(false);
  });
});

describe('an answer of somebody else', () => {
  const token = { headers: { authorization: 'Bearer x' } };
  it.each<[string, string, RequestInit, Response]>([
    [
      'a relay refuses a token',
      API,
      token,
      new Response('{}', { status: 401, headers: { ...json, 'www-authenticate': 'Bearer' } }),
    ],
    ['a relay refuses', API, {}, new Response('{}', { status: 403, headers: json })],
    ['a relay has no such robot', API, {}, new Response('{}', { status: 404, headers: json })],
    ['a proxy has no relay', API, {}, new Response('<h1>', { status: 502, headers: html })],
    [
      'a proxy misses its password, which the token has replaced',
      API,
      token,
      new Response('', { status: 401, headers: { 'www-authenticate': 'Basic' } }),
    ],
    [
      'a host answers a missing file with a page',
      `${OWN}/lecture/segments/7`,
      {},
      new Response('<p>', { headers: html }),
    ],
    [
      'another relay',
      'https://other.example/api/v1/robots',
      {},
      new Response('<form>', { status: 401, headers: html }),
    ],
  ])('is passed on: %s', async (_, url, init, answer) => {
    answerWith(answer);
    expect(await request(url, init)).toBe(answer);
    expect(signInNeeded.get()).toBe(false);
  });

  it('no network asks nobody to sign in', async () => {
    answerWith(new TypeError('Failed to fetch'));
    await expect(request(API)).rejects.toThrow(TypeError);
    expect(signInNeeded.get()).toBe(false);
  });

  it('of another origin is followed as ever, and that of the own one with care', async () => {
    answerWith(new Response('{}', { headers: json }));
    await request('https://cdn.example/api/v1/robots', { cache: 'no-cache' });
    await request(API, { cache: 'no-cache' });
    expect(asked.map(({ init }) => init)).toEqual([
      { cache: 'no-cache' },
      { cache: 'no-cache', redirect: 'manual' },
    ]);
  });
});

it('a stream asks why it failed once plain HTTP has failed as well, and is done with that when it opens', async () => {
  const target = () => Object.assign(new EventTarget(), { hidden: false });
  vi.stubGlobal('document', target());
  vi.stubGlobal('window', target());
  vi.stubGlobal('Worker', FakeWorker);
  const client = new StreamClient(
    new RobotTwin('demo', 0),
    'wss://robots.example/api/v1/robots/demo/live',
    30,
  );
  const link = (by: string, phase: string, code: number) =>
    FakeWorker.last?.onmessage?.({
      data: { kind: 'link', by, phase, retryAtMs: null, ending: { code, reason: '' }, moves: false },
    });
  answerWith(new Response('', { status: 401 }));
  link('websocket', 'waiting', 1006);
  link('events', 'waiting', 1012);
  expect(asked).toEqual([]);
  link('events', 'waiting', 1006);
  await vi.waitUntil(() => signInNeeded.get());
  expect(asked.map(({ url, init }) => [url, init.method])).toEqual([[`${API}/demo`, 'HEAD']]);
  link('websocket', 'waiting', 1006);
  link('events', 'waiting', 1006);
  expect(asked, 'it is known').toHaveLength(1);
  link('websocket', 'open', 1006);
  expect(signInNeeded.get()).toBe(false);
  client.close();
});

it('the words say so, whatever else ended', () => {
  const verdict = { word: 'STALE', cause: 'no connection', ageMs: 3200, past: null } as never;
  const link = {
    phase: 'waiting',
    retryAtMs: 11_000,
    ending: { code: 1006, reason: '' },
    behindMs: null,
  } as never;
  expect(stageWords(verdict, link, 0)).toBe('No connection. Trying again in 11 s.');
  signInNeeded.set(true);
  expect(stageWords(verdict, link, 0)).toBe('Sign in again.');
  expect(chipWords(verdict, link, 0).more).toBe(': sign in again');
});

describe('every request of the page', () => {
  const src = path.resolve(import.meta.dirname, '../../src');
  const files = readdirSync(src, { recursive: true, encoding: 'utf8' }).filter((file) =>
    /\.tsx?$/.test(file),
  );
  const having = (what: RegExp) =>
    files.filter((file) =>
      what.test(readFileSync(path.join(src, file), 'utf8').replace(/\/\*\*.*?\*\//gs, '')),
    );

  it('carries the credentials of the own origin, and none to others, because none says otherwise', () => {
    expect(having(/\bcredentials\b|withCredentials|XMLHttpRequest|EventSource|use-credentials/)).toEqual([]);
  });

  it('asks for data with `request`, which notices a proxy; the others ask for the page itself', () => {
    expect(having(/(?<![.\w#])fetch\((?!\)|\w+: )/).sort()).toEqual([
      'app/share/ShareSheet.tsx',
      'app/shell/late.tsx',
      'browser/retry.ts',
      'relay/relay.ts',
      'relay/request.ts',
      'stream/lane/open_lane.ts', // of the worker, for which `StreamClient` asks
      'stream/sse.ts',
    ]);
  });
});
