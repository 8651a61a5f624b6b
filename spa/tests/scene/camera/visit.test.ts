import { describe, expect, it } from 'vitest';
import { transform } from '../../../src/model/kinematics.ts';
import type { PlacedBox } from '../../../src/model/posed_body.ts';
import { CameraRig } from '../../../src/scene/camera/camera_rig.ts';

const HAND = [0, 0.35, 0.8] as const;
const FOOT = [0.1, -0.1, 0.1] as const;
const TRUNK: PlacedBox = [
  { matrixWorld: { elements: transform([0, 0, 0.9], [1, 0, 0, 0]) } },
  { min: [-0.12, -0.2, -0.3], max: [0.12, 0.2, 0.3] },
];

function rig(): CameraRig {
  const made = new CameraRig();
  made.resize(800, 600);
  made.frame([-0.3, -0.4, 0], [0.3, 0.4, 1.4], false);
  return made;
}

function expectNear(a: readonly number[], b: readonly number[]): void {
  for (const [axis, metres] of a.entries()) expect(metres).toBeCloseTo(b[axis]!, 6);
}

describe('a visit to a joint', () => {
  it('comes close, around the body if that hides it, and goes back to where it began', () => {
    const made = rig();
    made.look('side', false);
    made.orbit(0.3, 0.1);
    const before = made.eye;
    made.visit(HAND, [TRUNK], false);
    expect(made.target).toEqual(HAND);
    const free = made.eye;
    made.goBack(false);
    expectNear(made.position, before.position);
    made.visit(HAND, [], false);
    const off = Math.hypot(...free.position.map((metres, axis) => metres - made.position[axis]!));
    expect(off, 'without the trunk it need not turn').toBeGreaterThan(0.3);
  });

  it('to one joint after another goes back to before the first; twice goes back once', () => {
    const made = rig();
    const before = made.eye;
    made.visit(HAND, [], false);
    made.visit(FOOT, [], false);
    made.goBack(false);
    expectNear(made.position, before.position);
    made.orbit(1, 0);
    const { position } = made;
    made.goBack(false);
    expect(made.position).toEqual(position);
  });

  it('that a hand has changed is not undone, and the next one goes back to what the hand chose', () => {
    const changes: readonly ((made: CameraRig) => void)[] = [
      (made) => made.orbit(0.13, 0),
      (made) => made.pan(40, 0),
      (made) => made.zoom(0.85),
      (made) => made.look('front', false),
      (made) => made.standAt({ position: [2, 2, 2], target: [0, 0, 1] }),
    ];
    for (const change of changes) {
      const made = rig();
      made.visit(HAND, [], false);
      change(made);
      const { position } = made;
      made.visit(FOOT, [], false);
      made.goBack(false);
      expectNear(made.position, position);
      made.visit(FOOT, [], false);
      change(made);
      const chosen = made.position;
      made.goBack(false);
      expect(made.position).toEqual(chosen);
    }
  });

  it('is not changed by the slip of a clicking mouse', () => {
    const made = rig();
    const before = made.eye;
    made.visit(HAND, [], false);
    made.drag(2, -1);
    made.goBack(false);
    expectNear(made.position, before.position);
  });

  it('goes along with a robot that walks, there and back, also when it is left on its way', () => {
    const made = rig();
    const walked = rig();
    made.visit(HAND, [], true);
    made.advance(0.1);
    for (const each of [made, walked]) each.follow(5, 1);
    made.goBack(true);
    expect(made.moving).toBe(true);
    while (made.advance(0.1));
    expectNear(made.position, walked.position);
    expectNear(made.target, walked.target);
  });

  it('leaves no view chosen where none was, so that the robot still fits when the picture changes', () => {
    const made = rig();
    made.visit(HAND, [], false);
    expect(made.stand).not.toBeNull();
    made.resize(390, 480);
    made.goBack(false);
    expect(made.stand).toBeNull();
    const narrow = new CameraRig();
    narrow.resize(390, 480);
    narrow.frame([-0.3, -0.4, 0], [0.3, 0.4, 1.4], false);
    expectNear(made.position, narrow.position);
  });

  it('is there and back at once for who wants no motion', () => {
    const made = new CameraRig({ still: () => true });
    const before = made.eye;
    made.visit(HAND, []);
    expect([made.target, made.moving]).toEqual([HAND, false]);
    made.goBack();
    expectNear(made.position, before.position);
  });
});
