// @vitest-environment happy-dom
import { afterEach, expect, it, vi } from 'vitest';
import { READY_MS, sleepUnseen } from '../../src/app/robot/use_body_view.ts';
import { PageVisibility } from '../../src/stream/client.ts';

/** A screen whose edges the test can move. */
class Edges {
  static made: Edges[] = [];
  watching = true;
  readonly say: (entries: { isIntersecting: boolean }[]) => void;

  constructor(say: (entries: { isIntersecting: boolean }[]) => void) {
    this.say = say;
    Edges.made.push(this);
  }

  observe(): void {}

  disconnect(): void {
    this.watching = false;
  }
}

function hide(hidden: boolean): void {
  Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
  document.dispatchEvent(new Event('visibilitychange'));
}

afterEach(() => {
  hide(false);
  Edges.made = [];
  vi.unstubAllGlobals();
});

it('tells when nobody can see the page, and when somebody can again', () => {
  vi.stubGlobal('IntersectionObserver', Edges);
  const told: boolean[] = [];
  const visibility = new PageVisibility((seen) => told.push(seen));
  const [edges] = Edges.made;
  edges!.say([{ isIntersecting: true }]);
  expect([visibility.visible, told]).toEqual([true, []]);
  edges!.say([{ isIntersecting: true }, { isIntersecting: false }]); // scrolled away
  hide(true);
  edges!.say([{ isIntersecting: true }]);
  expect(told).toEqual([false]); // in view, but in a hidden tab
  hide(false);
  expect([visibility.visible, told]).toEqual([true, [false, true]]);
  visibility.close();
  hide(true);
  expect([edges!.watching, told]).toEqual([false, [false, true]]);
});

it('goes by the tab alone where the browser can say no more', () => {
  vi.stubGlobal('IntersectionObserver', undefined);
  const told: boolean[] = [];
  const visibility = new PageVisibility((seen) => told.push(seen));
  hide(true);
  expect([visibility.visible, told]).toEqual([false, [false]]);
  visibility.close();
});

it('a view sleeps at once where it is scrolled away, and behind another tab after half a minute', () => {
  vi.stubGlobal('IntersectionObserver', Edges);
  vi.useFakeTimers();
  const told: boolean[] = [];
  const stop = sleepUnseen({ setAsleep: (asleep) => told.push(asleep) });
  const [edges] = Edges.made;
  edges!.say([{ isIntersecting: false }]);
  expect(told).toEqual([true]);
  edges!.say([{ isIntersecting: true }]);
  hide(true);
  vi.advanceTimersByTime(READY_MS - 1);
  hide(false); // only flipped through
  vi.advanceTimersByTime(READY_MS);
  expect(told).toEqual([true, false, false]);
  hide(true);
  vi.advanceTimersByTime(READY_MS);
  hide(false);
  expect(told).toEqual([true, false, false, true, false]);
  hide(true);
  stop();
  vi.advanceTimersByTime(READY_MS);
  expect(told).toHaveLength(5);
  vi.useRealTimers();
});
