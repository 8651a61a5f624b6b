import { type Box3, Matrix4, PerspectiveCamera, Vector3 } from 'three';
import { expect, it } from 'vitest';
import type { RobotNode } from './robot_node.ts';
import { RobotRow } from './robot_row.ts';

/** A robot so wide and tall, with its root in the middle of its floor; null: not there yet. */
function robot(size: readonly [number, number, number] | null, heading = 0) {
  const made = {
    size,
    heading,
    coarse: false,
    built: true,
    y: 0,
    get figure() {
      if (size === null) return null;
      return { root: { matrixWorld: new Matrix4().makeTranslation(0, made.y, 0) }, boxes: [] };
    },
    standAside: (y: number) => {
      made.y = y;
    },
    bounds: (into: Box3) => {
      const [x, y, z] = size ?? [0, 0, 0];
      return into.set(new Vector3(-x / 2, made.y - y / 2, 0), new Vector3(x / 2, made.y + y / 2, z));
    },
  };
  return made;
}

function line(...robots: ReturnType<typeof robot>[]): RobotRow {
  const made = new RobotRow();
  for (const each of robots) made.add(each as unknown as RobotNode);
  return made;
}

it('one stands where it is, and looks where it looks', () => {
  const alone = line(robot([0.4, 0.6, 1.3], 0.7));
  expect(alone.arrange().max.toArray()).toEqual([0.2, 0.3, 1.3]);
  expect(alone.middle()?.toArray()).toEqual([0, 0, 0]);
  expect([alone.several, alone.heading]).toEqual([false, 0.7]);
});

it('several stand apart, have their middle between them, and look nowhere together', () => {
  const [first, second] = [robot([0.4, 0.6, 1.3], 0.7), robot([0.4, 0.6, 1.3], 0.2)];
  const both = line(first, second);
  const box = both.arrange();
  expect(second.y - first.y).toBeGreaterThan(0.6);
  expect(box.min.y).toBeCloseTo(-box.max.y, 9);
  expect(both.middle()?.y).toBeCloseTo(0, 9);
  expect([both.several, both.heading]).toEqual([true, 0]);
});

it('one that is not there yet has no middle and no top, and takes no part in the picture', () => {
  const none = line(robot(null));
  expect(none.arrange().isEmpty()).toBe(true);
  expect(none.middle()).toBeNull();
  expect(none.topOf(none.robots[0]!, new PerspectiveCamera())).toBeNull();
});

it('knows where a head is in the picture, and that one behind the eye is nowhere', () => {
  const camera = new PerspectiveCamera(30, 1, 0.1, 100);
  camera.up.set(0, 0, 1);
  camera.position.set(5, 0, 1.3);
  camera.lookAt(0, 0, 1.3);
  camera.updateMatrixWorld();
  const alone = line(robot([0.4, 0.6, 1.3]));
  const top = alone.topOf(alone.robots[0]!, camera);
  expect([top?.x, top?.y]).toEqual([expect.closeTo(0, 6), expect.closeTo(0, 6)]);
  camera.lookAt(10, 0, 1.3);
  camera.updateMatrixWorld();
  expect(alone.topOf(alone.robots[0]!, camera)).toBeNull();
});

it('is coarse with one that is, and replaceable only where all are built', () => {
  const [one, two] = [robot([1, 1, 1]), robot([1, 1, 1])];
  const both = line(one, two);
  expect([both.coarse, both.built]).toEqual([false, true]);
  one.coarse = true;
  two.built = false;
  expect([both.coarse, both.built]).toEqual([true, false]);
});
