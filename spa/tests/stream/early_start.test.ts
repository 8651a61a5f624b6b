import { afterEach, expect, it, vi } from 'vitest';

const HOME = 'https://page.example/';
const CONFIG = { lane: 'https://cdn.example' };

/** Runs the early script of a robot's page, whose `config.json` arrives when released. Returns the messages to its worker. */
async function begin() {
  vi.resetModules();
  const told: object[] = [];
  const location = { href: `${HOME}#/r/demo`, search: '', hash: '#/r/demo', pathname: '/' };
  vi.stubGlobal('window', { location, localStorage: { getItem: () => null }, addEventListener: () => {} });
  vi.stubGlobal('location', location);
  vi.stubGlobal('document', { documentElement: { dataset: {} }, querySelector: () => null });
  vi.stubGlobal(
    'Worker',
    class {
      postMessage(message: object): void {
        told.push(message);
      }
    },
  );
  let letGo = (_answer: object | null): void => {};
  vi.stubGlobal('fetch', (url: URL) => {
    expect(url.href).toBe(`${HOME}config.json`);
    return new Promise((resolve) => {
      letGo = resolve;
    });
  });
  await import('../../src/early.ts');
  const settle = async (answer: object) => {
    letGo(answer);
    await vi.dynamicImportSettled();
    await vi.advanceTimersByTimeAsync(0);
  };
  return { told, settle };
}

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

it('opens no stream before config.json has said by which way, however late that is', async () => {
  vi.useFakeTimers();
  const { told, settle } = await begin();
  await vi.advanceTimersByTimeAsync(25_000);
  expect(told).toEqual([]);
  await settle({ ok: true, json: async () => CONFIG });
  await vi.waitFor(() => expect(told).toHaveLength(1));
  expect(told).toMatchObject([{ kind: 'open', lane: 'https://cdn.example/api/v1/robots/demo/past' }]);
});

it('opens it at the relay where there is no config', async () => {
  vi.useFakeTimers();
  const { told, settle } = await begin();
  await settle({ ok: false });
  await vi.waitFor(() => expect(told).toHaveLength(1));
  expect(told).toMatchObject([
    { kind: 'open', url: 'wss://page.example/api/v1/robots/demo/live', lane: null },
  ]);
});
