// @vitest-environment happy-dom
import { createHash } from 'node:crypto';
import { beforeEach, expect, it, vi } from 'vitest';
import { builtModelAt, lodBytes, manifestAt } from '../../src/model/files.ts';

const LOW = Uint8Array.from({ length: 3000 }, (_, i) => i % 251);
const file = {
  name: 'low',
  path: 'low.glb',
  bytes: LOW.length,
  sha256: createHash('sha256').update(LOW).digest('hex'),
};
const MANIFEST = { v: 2, robot: 'r', links: ['base'], joints: [], visuals: [], levels: [file] };
const never = new AbortController().signal;

let asked: string[] = [];
let answer: (url: string) => Response = () => new Response('', { status: 404 });
let turn = 0;
/** A new address for each test, because the page caches what it has fetched. */
let url = '';

beforeEach(() => {
  asked = [];
  turn += 1;
  url = `http://relay/${turn}/manifest.json`;
  answer = (at) => (at.endsWith('.json') ? Response.json(MANIFEST) : new Response(LOW.slice()));
  vi.stubGlobal('fetch', async (at: string) => {
    asked.push(at.slice(at.lastIndexOf('/') + 1));
    return answer(at);
  });
});

it('the manifest is asked for once, its coarsest level right after, and whoever comes later finds both', async () => {
  const [one, two] = await Promise.all([builtModelAt(url), builtModelAt(url)]);
  expect(one?.links).toEqual(two?.links);
  expect((await manifestAt(url)).v).toBe(2);
  const heard: number[] = [];
  const bytes = await lodBytes(file, url, never, (received) => heard.push(received));
  expect(bytes).toEqual(LOW);
  expect(heard.at(-1)).toBe(LOW.length);
  expect(asked).toEqual(['manifest.json', 'low.glb']);
});

it('a level that nobody asked for ahead is fetched when wanted', async () => {
  expect(await lodBytes({ ...file, name: 'other' }, url, never, () => {})).toEqual(LOW);
  expect(asked).toEqual(['low.glb']);
});

it('a level that somebody has already is not fetched ahead', async () => {
  const bytes = LOW.map((value) => 255 - value);
  const other = { ...file, sha256: createHash('sha256').update(bytes).digest('hex') };
  answer = (at) =>
    at.endsWith('.json') ? Response.json({ ...MANIFEST, levels: [other] }) : new Response(bytes.slice());
  await lodBytes(other, url, never, () => {});
  await builtModelAt(url);
  for (let tick = 0; tick < 20; tick += 1) await new Promise((resolve) => setTimeout(resolve));
  expect(asked).toEqual(['low.glb', 'manifest.json']);
});

it('a manifest that did not come is asked for again', async () => {
  answer = () => new Response('', { status: 503 });
  await expect(manifestAt(url)).rejects.toThrow('manifest.json: answered 503');
  answer = () => Response.json(MANIFEST);
  expect((await manifestAt(url)).v).toBe(2);
});

it('bytes that are too few, too many or others are refused by name', async () => {
  for (const [wrong, why] of [
    [LOW.slice(1), /2999 bytes instead of 3000/],
    [new Uint8Array(3001), /longer than 3000 bytes/],
    [LOW.slice().fill(0, 7, 9), /its SHA-256 does not match/],
  ] as const) {
    answer = () => new Response(wrong.slice());
    await expect(lodBytes(file, url, never, () => {})).rejects.toThrow(why);
  }
});

it('who leaves stops the fetch', async () => {
  const leave = new AbortController();
  let heard: AbortSignal | undefined;
  vi.stubGlobal('fetch', (_: string, { signal }: RequestInit) => {
    heard = signal as AbortSignal;
    return new Promise((_yes, no) => signal?.addEventListener('abort', () => no(new Error('left'))));
  });
  const wanted = lodBytes(file, url, leave.signal, () => {});
  await vi.waitFor(() => expect(heard).toBeDefined());
  leave.abort();
  await expect(wanted).rejects.toThrow('low.glb: no answer');
  expect(heard?.aborted).toBe(true);
});
