import { expect, test } from 'vitest';
import { closeTo, playKey } from './camera_controls.ts';

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
  ['ArrowLeft', false, 'orbit 0.13 0.00'],
  ['ArrowUp', false, 'orbit 0.00 0.13'],
  ['ArrowDown', true, 'pan 0.00 -40.00'],
  ['+', true, 'zoom 0.85'],
  ['=', false, 'zoom 0.85'],
  ['-', false, 'zoom 1.18'],
  ['0', false, 'look home'],
  ['3', false, 'look top'],
  ['c', false, 'focus head'],
])('%s (Shift: %s) is %s', (key, shiftKey, does) => {
  const { view, told } = eye();
  expect(playKey(view, { key, shiftKey }, { x: 5, y: 6 })).toBe(true);
  expect(told).toEqual([does]);
});

test('keys of others are left to them', () => {
  const { view, told } = eye();
  for (const key of ['t', 'f', 'Tab', 'Enter', '9', 'constructor']) {
    expect(playKey(view, { key, shiftKey: false }, { x: 0, y: 0 })).toBe(false);
  }
  expect(told).toEqual([]);
});

test('where no link is, the first view comes back', () => {
  const { view, told } = eye(null);
  closeTo(view, { x: 5, y: 6 });
  expect(told).toEqual(['look home']);
});
