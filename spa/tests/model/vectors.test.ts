import { Matrix4, Quaternion, Vector3 } from 'three';
import { expect, it } from 'vitest';
import {
  cross,
  directionThrough,
  dot,
  normalize,
  pointThrough,
  quatOfTransform,
  rejectFrom,
  rotateAbout,
} from '../../src/model/vectors.ts';
import type { Vec3 } from '../../src/twin/rotation.ts';

const close = (v: Iterable<number>) => [...v].map((part) => expect.closeTo(part, 9));

it('agree with three.js, half turns included', () => {
  const turns = [
    ...[0.3, 2.9, Math.PI].flatMap((angle) =>
      (
        [
          [1, 0, 0],
          [0, 1, 0],
          [0, 0, 1],
          [1, -1, 0],
          [-1, 2, 3],
        ] as const
      ).map((axis) => ({ axis: normalize(axis), angle })),
    ),
  ];
  for (const { axis, angle } of turns) {
    const turn = new Quaternion().setFromAxisAngle(new Vector3(...axis), angle);
    const m = new Matrix4().compose(new Vector3(4, 5, 6), turn, new Vector3(1, 1, 1));
    const v: Vec3 = [0.2, -0.7, 1.1];
    expect([...pointThrough(m.elements, v)]).toEqual(close(new Vector3(...v).applyMatrix4(m)));
    expect([...directionThrough(m.elements, v)]).toEqual(close(new Vector3(...v).transformDirection(m)));
    expect([...rotateAbout(axis, angle, v)]).toEqual(close(new Vector3(...v).applyQuaternion(turn)));
    const [w, x, y, z] = quatOfTransform(m.elements);
    expect(Math.abs(w * turn.w + x * turn.x + y * turn.y + z * turn.z)).toBeCloseTo(1, 9);
  }
});

it('have no direction where there is none', () => {
  expect(normalize([0, 0, 0])).toEqual([0, 0, 0]);
  expect(dot(rejectFrom([1, 2, 3], [0, 0, 1]), [0, 0, 1])).toBe(0);
  expect(cross([1, 0, 0], [0, 1, 0])).toEqual([0, 0, 1]);
});
