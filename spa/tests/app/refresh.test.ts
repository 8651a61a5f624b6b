// @vitest-environment happy-dom
import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { refreshWith } from '../../src/app/shell/refresh.ts';
import { onTick } from '../../src/app/state/hooks.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { codesWith, SCHEMA, stateOf } from '../rigs/schema.ts';

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

function written(leastMs?: number) {
  const twin = new RobotTwin('small', 0);
  twin.acceptSchema(SCHEMA);
  let told = () => {};
  let writes = 0;
  const also = (listener: () => void) => {
    told = listener;
    return () => {
      told = () => {};
    };
  };
  const end = refreshWith(
    twin,
    () => {
      writes += 1;
    },
    [also],
    leastMs,
  );
  const frame = () => twin.acceptState(stateOf(codesWith()));
  return { frame, end, tell: () => told(), writes: () => writes };
}

it('writes ten times a second at most, whoever tells, and once more for the last', () => {
  const { frame, tell, writes } = written();
  vi.advanceTimersByTime(0);
  expect(writes()).toBe(1);
  for (let n = 0; n < 300; n += 1) {
    frame();
    tell();
    vi.advanceTimersByTime(10);
  }
  expect(writes()).toBeLessThanOrEqual(31);
  vi.advanceTimersByTime(100);
  const before = writes();
  frame();
  vi.advanceTimersByTime(100);
  expect(writes()).toBe(before + 1);
  vi.advanceTimersByTime(10_000);
  expect(writes(), 'nothing new, nothing written').toBe(before + 1);
});

it('goes on without frames where that is wanted, and ends', () => {
  const { end, frame, writes } = written(500);
  vi.advanceTimersByTime(5000);
  expect(writes()).toBe(10);
  end();
  frame();
  vi.advanceTimersByTime(5000);
  expect(writes()).toBe(10);
});

it('one timer tells all who wait for time, each as often as it wants, and nobody on a hidden page', () => {
  const timers = vi.spyOn(globalThis, 'setInterval');
  const listeners = [vi.fn(), vi.fn()];
  const told = () => listeners.map(({ mock }) => mock.calls.length);
  const stop = [250, 1000].map((everyMs, i) => onTick(everyMs, listeners[i]!));
  vi.advanceTimersByTime(2000);
  expect(told()).toEqual([8, 2]);
  const hidden = vi.spyOn(document, 'hidden', 'get').mockReturnValue(true);
  vi.advanceTimersByTime(5000);
  expect(told()).toEqual([8, 2]);
  hidden.mockRestore();
  document.dispatchEvent(new Event('visibilitychange'));
  expect(told(), 'at once when it is seen again').toEqual([9, 3]);
  for (const off of stop) off();
  vi.advanceTimersByTime(5000);
  expect(told()).toEqual([9, 3]);
  expect(timers).toHaveBeenCalledOnce();
});
