import { expect, it } from 'vitest';
import { FACET_AT, FACET_STRIDE, Facets, MOST_FACETS } from '../../../src/scene/signs/balance/shapes.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';

const CORNERS: readonly [Vec3, Vec3, Vec3] = [
  [1, 2, 3],
  [4, 5, 6],
  [7, 8, 9],
];

it('keeps corners, colour and whether a facet shows through, in the order in which they came', () => {
  const facets = new Facets();
  facets.begin();
  facets.add(...CORNERS, { color: 0xff8000, opacity: 0.5, through: true });
  facets.add(...CORNERS, { color: 0x000000 });
  expect(facets.count, 'not before it is complete').toBe(0);
  expect(facets.end()).toBe(true);
  expect(facets.count).toBe(2);
  const [one, other] = [0, FACET_STRIDE];
  expect([...facets.numbers.subarray(one, one + 9)]).toEqual([1, 2, 3, 4, 5, 6, 7, 8, 9]);
  const tint = [...facets.numbers.subarray(one + FACET_AT.tint, one + FACET_AT.tint + 4)];
  expect(tint.map((part) => Math.round(part * 255))).toEqual([255, 128, 0, 128]);
  expect(facets.numbers[one + FACET_AT.through]).toBe(1);
  expect(facets.numbers[other + FACET_AT.tint + 3], 'opaque unless it says so').toBe(1);
  expect(facets.numbers[other + FACET_AT.through]).toBe(0);
});

it('says whether a picture differs from the one before', () => {
  const facets = new Facets();
  const make = (x: number, count = 1) => {
    facets.begin();
    for (let i = 0; i < count; i += 1) facets.add([x, 0, 0], CORNERS[1], CORNERS[2], { color: 0 });
    return facets.end();
  };
  expect(make(0)).toBe(true);
  expect(make(0)).toBe(false);
  expect(make(1)).toBe(true);
  expect(make(1, 2)).toBe(true);
  expect(make(1, 0)).toBe(true);
  expect(facets.count).toBe(0);
});

it('leaves out what is too much', () => {
  const facets = new Facets();
  facets.begin();
  for (let i = 0; i < MOST_FACETS + 10; i += 1) facets.add(...CORNERS, { color: 0 });
  facets.end();
  expect(facets.count).toBe(MOST_FACETS);
});
