// @vitest-environment happy-dom
import { Box3, Vector3 } from 'three';
import { expect, test, vi } from 'vitest';
import { CameraRig } from './camera.ts';

const HUMANOID = new Box3(new Vector3(-0.15, -0.3, 0), new Vector3(0.2, 0.3, 1.3));

function rig(onChange = () => {}): CameraRig {
  const made = new CameraRig(document.createElement('canvas'), onChange);
  made.resize(1000, 800);
  made.frame(HUMANOID);
  return made;
}

/** Corners of a box on the screen: −1…1 is inside. */
function reachOnScreen(made: CameraRig, box: Box3): number {
  made.camera.updateMatrixWorld();
  let reach = 0;
  for (let corner = 0; corner < 8; corner += 1) {
    const [x, y, z] = [1, 2, 4].map((bit, axis) => (corner & bit ? box.max : box.min).getComponent(axis));
    const point = new Vector3(x, y, z).project(made.camera);
    reach = Math.max(reach, Math.abs(point.x), Math.abs(point.y));
  }
  return reach;
}

test('a humanoid is first seen from about three metres, 45° from ahead, Z up, looked at in its middle', () => {
  const made = rig();
  const eye = made.camera.position.clone().sub(made.target);
  expect(eye.length()).toBeGreaterThan(2.7);
  expect(eye.length()).toBeLessThan(3.6);
  expect(eye.x).toBeCloseTo(-eye.y, 6);
  expect(eye.z).toBeGreaterThan(0);
  expect(made.target.z).toBeCloseTo(0.65, 6);
});

test.each([
  ['a desk arm', 0.2, 1.6],
  ['a humanoid on a phone', 1, 0.56],
  ['a giant', 40, 1.6],
])('%s is in the picture whole, and not small in it', (_, scale, aspect) => {
  const made = rig();
  const box = new Box3(
    HUMANOID.min.clone().multiplyScalar(scale),
    HUMANOID.max.clone().multiplyScalar(scale),
  );
  made.resize(800 * aspect, 800);
  made.frame(box);
  for (const view of ['home', 'front', 'side', 'top'] as const) {
    made.look(view, false);
    expect(reachOnScreen(made, box)).toBeLessThan(1);
    if (view !== 'top') expect(reachOnScreen(made, box)).toBeGreaterThan(0.6);
  }
});

test('front looks from ahead, side from its right, top has ahead upwards', () => {
  const made = rig();
  const eyeFrom = (view: 'front' | 'side' | 'top') => {
    made.look(view, false);
    return made.camera.position.clone().sub(made.target).normalize();
  };
  expect(eyeFrom('front').x).toBeGreaterThan(0.99);
  expect(eyeFrom('side').y).toBeLessThan(-0.99);
  expect(eyeFrom('top').z).toBeGreaterThan(0.99);
  made.camera.updateMatrixWorld();
  const ahead = new Vector3(1, 0, 0).add(made.target).project(made.camera);
  expect(ahead.y).toBeGreaterThan(0.1);
  expect(Math.abs(ahead.x)).toBeLessThan(1e-3);
});

test('a turn to a view takes a quarter of a second, asks for ticks meanwhile, and then for none', () => {
  const made = rig();
  made.look('front');
  expect(made.advance(0.1)).toBe(true);
  expect(made.advance(0.1)).toBe(true);
  expect(made.advance(0.1)).toBe(false);
  expect(made.camera.position.y).toBeCloseTo(made.target.y, 6);
});

test('with reduced motion a view is there at once', () => {
  vi.spyOn(window, 'matchMedia').mockReturnValue({ matches: true } as MediaQueryList);
  const made = rig();
  made.look('front');
  expect(made.camera.position.y).toBeCloseTo(made.target.y, 6);
  expect(made.advance(0.01)).toBe(false);
  vi.restoreAllMocks();
});

test('sway moves nothing, a walk takes the camera along', () => {
  const made = rig();
  const before = made.camera.position.clone();
  made.follow(0.05, 0.08);
  expect(made.camera.position).toEqual(before);
  made.follow(5, 0);
  expect(made.camera.position.x - before.x).toBeGreaterThan(4.5);
  expect(made.camera.position.z).toBe(before.z);
  expect(made.target.x).toBeGreaterThan(4.5);
});
