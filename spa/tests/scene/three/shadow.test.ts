import { Matrix4, Vector3 } from 'three';
import { expect, test } from 'vitest';
import { ShadowCaster } from '../../../src/scene/three/shadow.ts';

test('each block fills its box, where its link is', () => {
  const caster = new ShadowCaster(2);
  const link = { matrixWorld: new Matrix4().makeRotationZ(Math.PI / 2).setPosition(5, 0, 0) };
  caster.follow([[link, { min: [0, -1, 2], max: [4, 1, 2.5] }]]);
  expect(caster.blocks.count).toBe(1);
  const matrix = new Matrix4();
  caster.blocks.getMatrixAt(0, matrix);
  const top = new Vector3(1, 1, 1).applyMatrix4(matrix);
  expect(top.toArray().map((value) => Math.round(value * 1e5) / 1e5)).toEqual([4, 4, 2.5]);
});

test('more boxes than it was made for are not drawn', () => {
  const caster = new ShadowCaster(1);
  const link = { matrixWorld: new Matrix4() };
  const box = { min: [0, 0, 0], max: [1, 1, 1] } as const;
  caster.follow([1, 2, 3].map(() => [link, { min: [...box.min], max: [...box.max] }] as const));
  expect(caster.blocks.count).toBe(1);
});

test('a block touches all six sides of its cube: soles stand on the floor', () => {
  const { geometry } = new ShadowCaster(1).blocks;
  geometry.computeBoundingBox();
  for (const value of [...geometry.boundingBox!.min, ...geometry.boundingBox!.max]) {
    expect(Math.abs(value)).toBeCloseTo(1, 2);
  }
});
