import { PerspectiveCamera } from 'three';
import { expect, it } from 'vitest';
import type { RobotNode } from '../../../src/scene/three/robot_node.ts';
import { SceneRow } from '../../../src/scene/three/scene_row.ts';

/** A robot of this width and height, with its root in the middle of its floor; null: not loaded yet. */
function robot(size: readonly [number, number, number] | null) {
  const box = () => {
    if (size === null) return null;
    const [x, y, z] = size;
    return { min: [-x / 2, -y / 2, 0], max: [x / 2, y / 2, z] };
  };
  return { coarse: false, built: true, box };
}

function line(...robots: ReturnType<typeof robot>[]): SceneRow {
  const made = new SceneRow();
  for (const each of robots) made.add(each as unknown as RobotNode);
  return made;
}

it('one that is not there yet has no top', () => {
  const none = line(robot(null));
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
