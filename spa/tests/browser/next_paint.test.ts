import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { afterNextPaint } from '../../src/browser/painting.ts';

let done = false;
let repaint: (() => void)[] = [];
const wait = (hidden: boolean) => {
  vi.stubGlobal('document', { hidden });
  afterNextPaint().then(() => {
    done = true;
  });
};

beforeEach(() => {
  done = false;
  repaint = [];
  vi.useFakeTimers();
  vi.stubGlobal('requestAnimationFrame', (tick: () => void) => repaint.push(tick));
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

it('waits for the next picture, and for what is drawn in it by others that asked later', async () => {
  wait(false);
  await vi.advanceTimersByTimeAsync(60_000);
  expect(done).toBe(false);
  for (const tick of repaint) tick();
  await Promise.resolve();
  expect(done, 'the picture is not out yet').toBe(false);
  await vi.advanceTimersByTimeAsync(1);
  expect(done).toBe(true);
});

it('waits for no picture of a hidden page', async () => {
  wait(true);
  await vi.advanceTimersByTimeAsync(0);
  expect(done).toBe(true);
  expect(repaint).toEqual([]);
});
