// @vitest-environment happy-dom
import { expect, test } from 'vitest';
import { onTaps } from '../../../src/scene/figure/taps.ts';

interface Point {
  readonly x?: number;
  readonly y?: number;
  readonly isPrimary?: boolean;
  readonly button?: number;
}

/** A surface with the test's clock, the taps recorded there, and the double taps. */
function surface() {
  const element = document.createElement('div');
  const once: [number, number][] = [];
  const told: [number, number][] = [];
  const end = onTaps(element, (x, y, times) => (times === 1 ? once : told).push([x, y]));
  const tell = (type: string, ms: number, { x = 0, y = 0, isPrimary = true, button = 0 }: Point) => {
    const event = new PointerEvent(type, { clientX: x, clientY: y, isPrimary, button });
    Object.defineProperty(event, 'timeStamp', { value: ms });
    element.dispatchEvent(event);
  };
  const tap = (ms: number, point: Point = {}, heldMs = 60) => {
    tell('pointerdown', ms, point);
    tell('pointerup', ms + heldMs, point);
  };
  return { tap, tell, once, told, end };
}

test('two quick taps at one place are told once', () => {
  const { tap, told } = surface();
  tap(0, { x: 100, y: 50 });
  expect(told).toEqual([]);
  tap(200, { x: 108, y: 55 });
  expect(told).toEqual([[108, 55]]);
  tap(400, { x: 108, y: 55 }); // the third is the first of the next pair
  expect(told).toHaveLength(1);
});

test.each([
  ['slowly', 600, {}],
  ['far apart', 200, { x: 80 }],
  ['with another finger', 200, { isPrimary: false }],
  ['with another button', 200, { button: 2 }],
])('not when the second comes %s', (_, ms, point) => {
  const { tap, told } = surface();
  tap(0);
  tap(ms, point);
  expect(told).toEqual([]);
});

test('not after a drag, a long press, or the end', () => {
  const { tap, tell, told, end } = surface();
  tap(0);
  tell('pointerdown', 150, {});
  tell('pointerup', 250, { x: 90 });
  tap(400);
  tap(500, {}, 900);
  tap(1500);
  expect(told).toEqual([]);
  end();
  tap(1600);
  expect(told).toEqual([]);
});

test('a single tap is told at once; a drag is none', () => {
  const { tap, tell, once, told } = surface();
  tap(0, { x: 7, y: 8 });
  expect(once).toEqual([[7, 8]]);
  tell('pointerdown', 1000, {});
  tell('pointerup', 1100, { x: 90 });
  tap(2000, {}, 900);
  expect(once).toHaveLength(1);
  expect(told).toEqual([]);
});
