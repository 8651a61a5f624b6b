import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { keepLoading } from '../../src/app/robot/use_body_view.ts';
import { retryNow } from '../../src/browser/retry.ts';
import type { ModelReport } from '../../src/model/report.ts';

let up = true;
beforeEach(() => {
  up = true;
  vi.useFakeTimers();
  vi.stubGlobal('fetch', async () => {
    if (!up) throw new TypeError('no network');
    return new Response();
  });
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

function loading(result: () => Partial<ModelReport>) {
  const reports: (string | undefined)[] = [];
  let loads = 0;
  const load = async () => {
    loads += 1;
    return { missing: [], joints: [], ignored: [], problems: [], ...result() };
  };
  const stop = keepLoading('http://r/model', load, ({ error }) => reports.push(error));
  return { reports, stop, loads: () => loads };
}

it('a model that did not come is loaded again when its server answers', async () => {
  up = false;
  const { reports, loads } = loading(() => (up ? {} : { error: 'no answer', passing: true }));
  await vi.advanceTimersByTimeAsync(60_000);
  expect(reports).toEqual(['no answer']);
  expect(loads(), 'what is shown stays').toBe(1);
  up = true;
  retryNow();
  await vi.advanceTimersByTimeAsync(0);
  expect(reports).toEqual(['no answer', undefined]);
});

it('one that is wrong is not loaded again, and neither is one that nobody wants any more', async () => {
  const wrong = loading(() => ({ error: 'model manifest: not JSON' }));
  const left = loading(() => ({ error: 'no answer', passing: true }));
  await vi.advanceTimersByTimeAsync(0);
  left.stop();
  await vi.advanceTimersByTimeAsync(60_000);
  expect([wrong.loads(), left.loads()]).toEqual([1, 1]);
});
