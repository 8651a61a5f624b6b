// @vitest-environment happy-dom
import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { fetchPartsAhead, LatePart, setAway } from '../../src/browser/late_part.ts';
import { retryNow } from '../../src/browser/retry.ts';

vi.mock('../../src/browser/painting.ts', () => ({ firstPaint: () => Promise.resolve() }));

/** Whether the network is up; the requests sent. */
let up = true;
let asked: string[] = [];

beforeEach(() => {
  up = true;
  asked = [];
  vi.useFakeTimers();
  vi.stubGlobal('fetch', async (_: string, { method }: RequestInit) => {
    asked.push(method ?? '');
    if (!up) throw new TypeError('no network');
    return new Response();
  });
});
afterEach(() => {
  setAway(false);
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

/** A part that loads only while the network is up. */
function part<T>(what: T, ahead = false) {
  const made = new LatePart(
    async () => {
      asked.push('import');
      if (!up) throw new TypeError('Failed to fetch dynamically imported module');
      return what;
    },
    () => ahead,
  );
  const seen: boolean[] = [];
  made.subscribe(() => seen.push(made.failed()));
  return { made, seen };
}

it('is loaded once, for all who ask', async () => {
  const { made, seen } = part('x');
  expect(await Promise.all([made.load(), made.load()])).toEqual(['x', 'x']);
  expect(asked).toEqual(['import']);
  expect(seen).toEqual([false]);
});

it('that did not come is tried again by itself, and imported only when its server answers', async () => {
  const { made, seen } = part('x');
  up = false;
  const coming = made.load();
  await vi.advanceTimersByTimeAsync(60_000);
  expect(asked.filter((what) => what === 'import')).toHaveLength(1); // Firefox would cache a second failure too
  expect(asked.filter((what) => what === 'HEAD').length).toBeGreaterThan(3);
  expect(made.failed()).toBe(true);
  up = true;
  await vi.advanceTimersByTimeAsync(20_000);
  expect(await coming).toBe('x');
  expect(made.failed()).toBe(false);
  expect(seen.at(-1)).toBe(false);
});

it('is tried at once when somebody asks, or when the browser is online again', async () => {
  for (const ask of [retryNow, () => window.dispatchEvent(new Event('online'))]) {
    const { made } = part('x');
    up = false;
    void made.load();
    await vi.advanceTimersByTimeAsync(60_000);
    up = true;
    ask();
    await vi.advanceTimersByTimeAsync(0);
    expect(made.value()).toBe('x');
  }
});

it('is not even tried while the stream is down and its server silent', async () => {
  const { made } = part('x');
  up = false;
  setAway(true);
  void made.load();
  await vi.advanceTimersByTimeAsync(5000);
  expect(asked).not.toContain('import');
  expect(made.failed()).toBe(true);
});

it('may be fetched ahead, unless the network is away', async () => {
  const [later, never] = [part('x', true), part('y')];
  setAway(true);
  const first = fetchPartsAhead();
  await vi.advanceTimersByTimeAsync(60_000);
  await first;
  expect(later.made.value()).toBeNull();
  setAway(false);
  const second = fetchPartsAhead();
  await vi.advanceTimersByTimeAsync(60_000);
  await second;
  expect(later.made.value()).toBe('x');
  expect(never.made.value()).toBeNull();
});
