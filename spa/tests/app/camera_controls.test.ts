// @vitest-environment happy-dom
import { expect, test } from 'vitest';
import { cameraKeys, closeTo } from '../../src/app/robot/camera_controls.ts';
import type { KeyAction } from '../../src/app/shell/page_keys.ts';

/** A view that records its calls. */
function eye(link: string | null = 'head') {
  const told: string[] = [];
  const tell =
    (word: string) =>
    (...how: (string | number)[]) =>
      void told.push([word, ...how.map((x) => (typeof x === 'number' ? x.toFixed(2) : x))].join(' '));
  const view = {
    look: tell('look'),
    focus: tell('focus'),
    orbit: tell('orbit'),
    pan: tell('pan'),
    zoom: tell('zoom'),
    pick: (x: number, y: number) => (x === 5 && y === 6 ? link : null),
  };
  return { view, told };
}

test.each([
  ['turn', 'ArrowLeft', 'orbit 0.13 0.00'],
  ['turn', 'ArrowUp', 'orbit 0.00 0.13'],
  ['pan', 'ArrowDown', 'pan 0.00 -40.00'],
  ['nearer', '+', 'zoom 0.85'],
  ['farther', '-', 'zoom 1.18'],
  ['home', '0', 'look home'],
  ['top', '3', 'look top'],
  ['closeUp', 'c', 'focus head'],
] as const satisfies readonly (readonly [KeyAction, string, string])[])(
  '%s by %s is %s',
  (action, key, does) => {
    const { view, told } = eye();
    const keys = cameraKeys(view, () => ({ x: 5, y: 6 }));
    keys[action]?.(new KeyboardEvent('keydown', { key }));
    expect(told).toEqual([does]);
  },
);

test('where no link is, the first view comes back', () => {
  const { view, told } = eye(null);
  closeTo(view, { x: 5, y: 6 });
  expect(told).toEqual(['look home']);
});
