import { Matrix4, Quaternion, Vector3 } from 'three';
import { expect, test } from 'vitest';
import { emptyBox, growBox, lowestZ } from '../../src/model/bounds.ts';

test('the lowest point of a turned box is that of its lowest corner', () => {
  const corners: number[] = [];
  for (const x of [-0.1, 0.25]) {
    for (const y of [-0.05, 0.07]) for (const z of [-0.3, 0.02]) corners.push(x, y, z);
  }
  const box = emptyBox();
  growBox(box, corners, new Matrix4().elements);
  expect(box).toEqual({ min: [-0.1, -0.05, -0.3], max: [0.25, 0.07, 0.02] });

  for (let i = 0; i < 50; i += 1) {
    const axis = new Vector3(Math.sin(i), Math.cos(3 * i), Math.sin(7 * i + 1)).normalize();
    const m = new Matrix4().compose(
      new Vector3(i, -i, Math.cos(i)),
      new Quaternion().setFromAxisAngle(axis, i * 0.7),
      new Vector3(1, 1, 1),
    );
    const byCorner: number[] = [];
    for (let c = 0; c < corners.length; c += 3) {
      byCorner.push(new Vector3().fromArray(corners, c).applyMatrix4(m).z);
    }
    expect(lowestZ(box, m.elements)).toBeCloseTo(Math.min(...byCorner), 12);
  }
});

test('points are seen from the link, through scale and mount', () => {
  const box = emptyBox();
  growBox(box, [1, 2, 3], new Matrix4().makeScale(-0.5, 1, 2).setPosition(10, 0, 0).elements);
  expect(box.min).toEqual([9.5, 2, 6]);
  expect(box.max).toEqual(box.min);
});
