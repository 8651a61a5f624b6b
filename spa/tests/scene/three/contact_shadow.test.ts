import { Matrix4 } from 'three';
import { expect, test } from 'vitest';
import type { LinkBox } from '../../../src/model/bounds.ts';
import { ContactShadow, MOST_CONTACTS } from '../../../src/scene/three/environment.ts';

const SOLE: LinkBox = { min: [-0.1, -0.04, -0.05], max: [0.14, 0.04, 0] };
const at = (x: number, y: number, z: number, yaw = 0) =>
  [{ matrixWorld: new Matrix4().makeRotationZ(yaw).setPosition(x, y, z) }, SOLE] as const;

function contacts(...links: ReturnType<typeof at>[]): ContactShadow {
  const made = new ContactShadow();
  made.follow(links, 0.7);
  return made;
}

test('a sole on the floor leaves its own print, turned as it is', () => {
  const { place, size } = contacts(at(1, 2, 0.05, Math.PI / 2));
  expect(place[0]!.toArray()).toEqual([1, 2.02, 0, 1].map((v) => expect.closeTo(v)));
  expect(size[0]!.toArray()).toEqual([0.12, 0.04, 1, 0].map((v) => expect.closeTo(v)));
});

test('the higher the fainter, and soon nothing', () => {
  const { size } = contacts(at(0, 0, 0.05), at(0, 0.2, 0.08), at(0, 0.4, 0.5));
  expect(size[0]!.z).toBeCloseTo(1);
  expect(size[1]!.z).toBeGreaterThan(0.2);
  expect(size[1]!.z).toBeLessThan(0.6);
  expect(size[2]!.z).toBe(0);
});

test('one that lies down touches in many places: the nearest count', () => {
  const made = contacts(...Array.from({ length: 20 }, (_, i) => at(i, 0, 0.05 + i / 1000)));
  expect(made.place.map(({ x }) => Math.round(x - 0.02))).toEqual(
    Array.from({ length: MOST_CONTACTS }, (_, i) => i),
  );
  made.follow([], 0.7);
  expect(made.size.every(({ z }) => z === 0)).toBe(true);
});
