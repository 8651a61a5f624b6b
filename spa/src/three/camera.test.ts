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

test('what lies under notes and buttons is no room for a robot: it stands between them, whole', () => {
  const made = rig();
  const onScreen = (x: number, y: number, z: number) => new Vector3(x, y, z).project(made.camera);
  const lowest = () => Math.min(...[-0.3, 0.3].map((y) => onScreen(0.2, y, 0).y));
  const highest = () => Math.max(...[-0.3, 0.3].map((y) => onScreen(-0.2, y, 1.3).y));
  const covered = (above: number, below: number) => {
    made.cover({ above, below });
    while (made.advance(1));
    made.camera.updateMatrixWorld();
  };
  made.resize(390, 480);
  covered(60, 80);
  expect(lowest()).toBeGreaterThan(-1 + (2 * 80) / 480);
  expect(highest()).toBeLessThan(1 - (2 * 60) / 480);
  const between = lowest();
  covered(0, 0);
  expect(lowest(), 'and lower without').toBeLessThan(between);
});

test('what comes to cover the picture pushes the robot gently', () => {
  const made = rig();
  made.resize(390, 480);
  const { y } = new Vector3(0, 0, 0.6).project(made.camera);
  made.cover({ above: 100, below: 0 });
  expect(new Vector3(0, 0, 0.6).project(made.camera).y).toBeCloseTo(y, 1);
  expect(made.advance(0.1), 'on its way').toBe(true);
  expect(made.advance(1), 'there').toBe(false);
  expect(new Vector3(0, 0, 0.6).project(made.camera).y).toBeLessThan(y - 0.1);
});

test('comes close to a point, turns around it, moves, and nears, each within its bounds', () => {
  const made = rig();
  const distance = () => made.camera.position.distanceTo(made.target);
  const whole = distance();
  made.focus(new Vector3(0.1, 0.2, 1.1), false);
  expect(made.target).toEqual(new Vector3(0.1, 0.2, 1.1));
  expect(distance()).toBeLessThan(whole / 2);

  const before = made.camera.position.clone();
  made.orbit(Math.PI, 0);
  expect(made.camera.position.x - made.target.x).toBeCloseTo(-(before.x - made.target.x), 6);
  expect(made.camera.position.z).toBeCloseTo(before.z, 6);
  made.orbit(0, -10);
  expect(made.camera.position.z).toBeGreaterThan(made.target.z); // the floor has no underside

  const near = distance();
  made.zoom(0.5);
  expect(distance()).toBeCloseTo(near / 2, 6);
  for (let i = 0; i < 40; i += 1) made.zoom(0.5);
  expect(distance()).toBeGreaterThan(0.05);
  made.look('home', false);
  expect(distance()).toBeCloseTo(whole, 6);
});

test('a chosen point stays in the middle of the robot that walks on, and a frame leaves it alone', () => {
  const made = rig();
  made.focus(new Vector3(0, 0, 1.2), false);
  made.frame(HUMANOID);
  expect(made.target.z).toBe(1.2);
  made.follow(5, 0);
  expect(made.target.x).toBeGreaterThan(4.5);
});

test('stays, or turns with the robot, when asked to', () => {
  const made = rig();
  made.followMode = 'stay';
  const before = made.camera.position.clone();
  made.follow(5, 0, 0);
  expect(made.camera.position).toEqual(before);

  made.followMode = 'turn';
  made.follow(0, 0, 3.1);
  made.look('front', false);
  made.follow(0, 0, -3.1); // the shorter way round: 0.083 rad on
  const eye = made.camera.position.clone().sub(made.target);
  expect(Math.atan2(eye.y, eye.x)).toBeCloseTo(2 * Math.PI - 6.2, 6);
});
