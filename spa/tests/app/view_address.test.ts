// @vitest-environment happy-dom
import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { bindAddress } from '../../src/app/share/view_address.ts';
import type { RobotLink } from '../../src/app/state/robot_link.ts';
import { shownMoment } from '../../src/app/state/viewing.ts';
import { Emitter } from '../../src/kit.ts';
import type { BodyView } from '../../src/scene/figure/body_view.ts';

const MOMENT = Date.UTC(2026, 10, 22, 14, 2, 7);
let unbind: () => void;

beforeEach(() => {
  vi.useFakeTimers();
  window.location.hash = '#/r/demo';
  unbind = bindAddress(
    { stand: null } as BodyView,
    { twin: { schema: null, onChange: () => () => {} } } as unknown as RobotLink,
    new Emitter(),
  );
});

afterEach(() => {
  unbind();
  shownMoment.set(null);
  vi.useRealTimers();
});

const named = () => Date.parse(/[?&]t=([^&]+)/.exec(window.location.hash)?.[1] ?? '');

it('names the shown moment a second after it moved at the latest, and is written no more than once a second', () => {
  const writes = vi.spyOn(window.history, 'replaceState');
  const heard = vi.fn();
  window.addEventListener('hashchange', heard);
  for (let ms = 0; ms <= 30_000; ms += 100) {
    shownMoment.set(MOMENT + ms);
    vi.advanceTimersByTime(100);
    if (ms >= 1500) expect(MOMENT + ms - named()).toBeLessThanOrEqual(1000);
  }
  expect(writes.mock.calls.length).toBeGreaterThan(25);
  expect(writes.mock.calls.length).toBeLessThanOrEqual(31);
  expect(heard, 'it does not hear itself').not.toHaveBeenCalled();
});

it('names where the past rests, rounded up, and nothing once it is live', () => {
  shownMoment.set(MOMENT + 33.4);
  vi.advanceTimersByTime(1000);
  expect(named()).toBe(MOMENT + 34);
  shownMoment.set(MOMENT + 66.1);
  vi.advanceTimersByTime(1000);
  expect(named()).toBe(MOMENT + 67);
  shownMoment.set(null);
  vi.advanceTimersByTime(1000);
  expect(window.location.hash).toBe('#/r/demo');
});
