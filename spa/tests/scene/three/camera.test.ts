// @vitest-environment happy-dom
import { Vector3 } from 'three';
import { expect, test, vi } from 'vitest';
import { SceneCamera } from '../../../src/scene/three/camera.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';

const [WIDTH, HEIGHT] = [1000, 800];

function made(onChange = () => {}): SceneCamera {
  const canvas = document.createElement('canvas');
  vi.spyOn(canvas, 'clientHeight', 'get').mockReturnValue(HEIGHT);
  const scene = new SceneCamera(canvas, onChange);
  scene.rig.resize(WIDTH, HEIGHT);
  scene.rig.frame([-0.15, -0.3, 0], [0.2, 0.3, 1.3]);
  return scene;
}

/** The picture position of a point in the world according to three.js and according to the rig, CSS px. */
function both({ camera, rig }: SceneCamera, [x, y, z]: Vec3) {
  camera.updateMatrixWorld();
  const seen = new Vector3(x, y, z).project(camera);
  const m = rig.screenFromWorld();
  const row = (r: number) => m[r]! * x + m[r + 1]! * y + m[r + 2]! * z + m[r + 3]!;
  return {
    three: [((seen.x + 1) / 2) * WIDTH, ((1 - seen.y) / 2) * HEIGHT],
    rig: [row(0) / row(8), row(4) / row(8)],
  };
}

test('three.js sees every point where the rig has it, also between notes', () => {
  const scene = made();
  const { rig } = scene;
  const moves = [
    () => rig.look('front', false),
    () => rig.look('top', false),
    () => rig.orbit(0.4, -0.2),
    () => rig.zoom(0.6, 200, 300),
    () => rig.pan(30, -40),
    () => {
      rig.cover({ above: 60, below: 110 });
      while (rig.advance(1));
    },
    () => rig.follow(4, 1),
  ];
  for (const move of moves) {
    move();
    for (const point of [[0, 0, 0.6], rig.target, [0.2, -0.3, 1.3]] as const) {
      const at = both(scene, point);
      expect(at.three[0]).toBeCloseTo(at.rig[0]!, 6);
      expect(at.three[1]).toBeCloseTo(at.rig[1]!, 6);
    }
  }
});

test('the rig is where hands have put the camera, and asks for a picture', () => {
  let pictures = 0;
  const scene = made(() => (pictures += 1));
  const { rig, camera } = scene;
  const before = rig.eye;
  pictures = 0;
  scene.pan(40, 0);
  expect(pictures).toBeGreaterThan(0);
  expect(rig.target).not.toEqual(before.target);
  for (const [axis, value] of camera.position.toArray().entries()) {
    expect(rig.position[axis]).toBeCloseTo(value, 9);
    expect(rig.position[axis]! - rig.target[axis]!).toBeCloseTo(
      before.position[axis]! - before.target[axis]!,
      9,
    );
  }
  rig.frame([-1, -1, 0], [1, 1, 2]);
  expect(rig.target, 'a view that hands have chosen stays').not.toEqual([0, 0, 1]);
});

test('with reduced motion a view is there at once', () => {
  vi.spyOn(window, 'matchMedia').mockReturnValue({ matches: true } as MediaQueryList);
  const { rig } = made();
  rig.look('front');
  expect(rig.position[1]).toBeCloseTo(rig.target[1], 6);
  expect(rig.advance(0.01)).toBe(false);
  vi.restoreAllMocks();
});
