import { expect, test } from 'vitest';
import { readMasses, readSoles } from '../../src/model/balance/masses_and_soles.ts';
import { BundleError } from '../../src/model/bundle.ts';
import type { Manifest } from '../../src/model/manifest.ts';

const MASS = { link: 1, mass_kg: 2, xyz: [0, 0, 1], inertia: [1, 0, 0, 1, 0, 1] };
const POINTS = [
  [0, 0, 0],
  [1, 0, 0],
  [0, 1, 0],
];

function manifest(raw: Record<string, unknown>): Manifest {
  return { links: ['hip', 'left', 'right'], raw } as unknown as Manifest;
}

test('masses and soles as the edge writes them', () => {
  const found = manifest({ inertials: [MASS], soles: [{ link: 2, points: POINTS }] });
  expect(readMasses(found)).toEqual([{ link: 1, massKg: 2, xyz: [0, 0, 1], inertia: [1, 0, 0, 1, 0, 1] }]);
  expect(readSoles(found)).toEqual([{ link: 2, points: POINTS }]);
});

test('none there, and none known: a bundle of an older builder', () => {
  expect(readMasses(manifest({ inertials: [] }))).toEqual([]);
  expect(readSoles(manifest({ soles: [] }))).toEqual([]);
  expect(readMasses(manifest({}))).toBeNull();
  expect(readSoles(manifest({}))).toBeNull();
});

test.each([
  [
    'a robot of less than 1 g',
    [
      { ...MASS, mass_kg: 5e-4 },
      { ...MASS, link: 2, mass_kg: 4e-4 },
    ],
  ],
  ['a centre more than 100 m away', [MASS, { ...MASS, link: 2, xyz: [0, 0, -200] }]],
])("masses that can't be are none: %s", (_, inertials) => {
  expect(readMasses(manifest({ inertials }))).toEqual([]);
});

test('a link may weigh next to nothing where the robot does not', () => {
  expect(readMasses(manifest({ inertials: [MASS, { ...MASS, link: 2, mass_kg: 1e-9 }] }))).toHaveLength(2);
});

test.each([
  [{}, 'inertials is not a list'],
  [[MASS, MASS], 'inertials[1]: its link does not come after the one before'],
  [[MASS, MASS, MASS, MASS], 'inertials: too many entries, 4'],
  [[7], 'inertials[0] is not an object'],
  [[{ ...MASS, link: 3 }], 'inertials[0]: its link does not exist'],
  [[{ ...MASS, link: 'length' }], 'inertials[0]: its link does not exist'],
  [[{ ...MASS, link: 0.5 }], 'inertials[0]: its link does not exist'],
  [[{ ...MASS, mass_kg: 0 }], 'inertials[0].mass_kg is not above 0'],
  [[{ ...MASS, mass_kg: '2' }], 'inertials[0].mass_kg: not 1 numbers'],
  [[{ ...MASS, xyz: [0, 0] }], 'inertials[0].xyz: not 3 numbers'],
  [[{ ...MASS, inertia: [1, 1, 1] }], 'inertials[0].inertia: not 6 numbers'],
])('masses that are none are named: %j', (inertials, words) => {
  expect(() => readMasses(manifest({ inertials }))).toThrow(new BundleError(`model manifest: ${words}`));
});

test.each([
  [[{ link: 1, points: POINTS.slice(1) }], 'soles[0].points: fewer than 3'],
  [[{ link: 1, points: Array(17).fill([0, 0, 0]) }], 'soles[0].points: too many entries, 17'],
  [[{ link: 1, points: [...POINTS, [0, 0, null]] }], 'soles[0].points[3]: not 3 numbers'],
  [[{ link: -1, points: POINTS }], 'soles[0]: its link does not exist'],
])('and soles: %j', (soles, words) => {
  expect(() => readSoles(manifest({ soles }))).toThrow(new BundleError(`model manifest: ${words}`));
});
