import { beforeEach, expect, it, vi } from 'vitest';
import { startEarly, takeStream } from '../../src/stream/early_stream.ts';
import type { FromStream } from '../../src/stream/messages.ts';

class FakeWorker {
  static made: FakeWorker[] = [];
  onmessage: ((event: { data: FromStream }) => void) | null = null;
  onerror: (() => void) | null = null;
  told: unknown[] = [];
  ended = false;
  constructor(
    readonly url: string,
    readonly options: WorkerOptions,
  ) {
    FakeWorker.made.push(this);
  }
  postMessage(message: unknown): void {
    this.told.push(message);
  }
  terminate(): void {
    this.ended = true;
  }
  says(data: FromStream): void {
    this.onmessage?.({ data });
  }
}

const rate: FromStream = { kind: 'rate', hz: 30, reason: null };

beforeEach(() => {
  FakeWorker.made = [];
  vi.stubGlobal('Worker', FakeWorker);
  vi.stubGlobal('document', { hidden: false });
});

it('keeps what an early stream said for the page that takes it, and tells the model at once', () => {
  const hashes: string[] = [];
  startEarly('ws://r', 30, (hash) => hashes.push(hash));
  const [worker] = FakeWorker.made;
  expect(worker?.told).toEqual([
    { kind: 'open', url: 'ws://r', hz: 30, visible: true, lane: null, sleptMs: 0 },
  ]);
  worker?.says(rate);
  worker?.says({ kind: 'model', hash: 'abc' });
  expect(hashes).toEqual(['abc']);
  const taken = takeStream('ws://r', 30);
  expect(taken.worker).toBe(worker);
  expect(taken.messages).toEqual([rate, { kind: 'model', hash: 'abc' }]);
  expect(takeStream('ws://r', 30).worker, 'taken once').not.toBe(worker);
});

it('ends an early stream that the page does not want', () => {
  startEarly('ws://r', 30, () => {});
  takeStream('ws://other', 30);
  expect(FakeWorker.made.map(({ ended }) => ended)).toEqual([true, false]);
  takeStream('ws://r', 30);
  expect(FakeWorker.made.length).toBe(3);
});

it('ends an early stream whose page never comes, and one whose worker failed', () => {
  startEarly('ws://r', 30, () => {});
  for (let i = 0; i < 250; i += 1) FakeWorker.made[0]?.says(rate);
  expect(FakeWorker.made[0]?.ended).toBe(true);
  startEarly('ws://r', 30, () => {});
  FakeWorker.made[1]?.onerror?.();
  expect(FakeWorker.made[1]?.ended).toBe(true);
  expect(takeStream('ws://r', 30).messages).toEqual([]);
});

it('starts the worker from its file, and in a page without an origin from a script that imports that file', async () => {
  takeStream('ws://r', 30);
  vi.stubGlobal('origin', 'null');
  takeStream('ws://r', 30);
  vi.unstubAllGlobals();
  const [plain, made] = FakeWorker.made;
  expect(plain?.url).toMatch(/worker/);
  expect(plain?.options.type).toBe('module');
  expect(made?.url).toMatch(/^blob:/);
  expect(made?.options.type, 'Chromium starts no module from it').toBeUndefined();
  const script = await (await fetch(made?.url ?? '')).text();
  expect(script).toContain(`import(${JSON.stringify(plain?.url)})`);
});
