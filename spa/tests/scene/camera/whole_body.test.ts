import { describe, expect, it } from 'vitest';
import { cornersOf, type LinkBox } from '../../../src/model/bounds.ts';
import { transform } from '../../../src/model/kinematics.ts';
import type { PlacedBox } from '../../../src/model/posed_body.ts';
import { CameraRig } from '../../../src/scene/camera/camera_rig.ts';
import { spanOf } from '../../../src/scene/camera/whole_body.ts';
import type { Quat, Vec3 } from '../../../src/twin/rotation.ts';

/** Pictures as on a phone, a laptop and a wide screen. */
const PICTURES = [
  [390, 480],
  [860, 640],
  [1900, 700],
] as const;

/** A box of this size (metres) around its place, turned about the world's y (rad) and then about z. */
interface Part {
  readonly size: Vec3;
  readonly at: Vec3;
  readonly roll?: number;
  readonly yaw?: number;
}

function placed({ size, at, roll = 0, yaw = 0 }: Part): PlacedBox {
  const half = size.map((metres) => metres / 2) as [number, number, number];
  const box: LinkBox = { min: half.map((metres) => -metres) as [number, number, number], max: half };
  const [cr, sr, cy, sy] = [Math.cos(roll / 2), Math.sin(roll / 2), Math.cos(yaw / 2), Math.sin(yaw / 2)];
  const quat: Quat = [cy * cr, -sy * sr, cy * sr, sy * cr];
  return [{ matrixWorld: { elements: transform(at, quat) } }, box];
}

/** A camera that has framed these parts. */
function rigOf(parts: readonly Part[], [width, height]: readonly [number, number]): CameraRig {
  const rig = new CameraRig();
  rig.resize(width, height);
  const [min, max] = [
    [Infinity, Infinity, Infinity],
    [-Infinity, -Infinity, -Infinity],
  ] as [[number, number, number], [number, number, number]];
  for (const [{ matrixWorld }, box] of parts.map(placed)) {
    cornersOf(box, matrixWorld.elements, 0, (...point) => {
      for (const axis of [0, 1, 2] as const) {
        min[axis] = Math.min(min[axis], point[axis]);
        max[axis] = Math.max(max[axis], point[axis]);
      }
    });
  }
  rig.frame(min, max);
  return rig;
}

/** Lets the camera follow; returns how far the body extends in the picture, 1 being its edge. */
function reach(rig: CameraRig, parts: readonly Part[]): number {
  const boxes = parts.map(placed);
  const [x, y] = parts[0]!.at;
  rig.follow(x, y, parts[0]!.yaw ?? 0, spanOf(boxes));
  const m = rig.screenFromWorld();
  const { width, height } = rig.projection;
  let most = 0;
  for (const [{ matrixWorld }, box] of boxes) {
    cornersOf(box, matrixWorld.elements, 0, (px, py, pz) => {
      const row = (r: number) => m[r]! * px + m[r + 1]! * py + m[r + 2]! * pz + m[r + 3]!;
      expect(row(8)).toBeGreaterThan(0);
      most = Math.max(
        most,
        Math.abs((2 * row(0)) / row(8) / width - 1),
        Math.abs((2 * row(4)) / row(8) / height - 1),
      );
    });
  }
  return most;
}

const times = (seconds: number, hz = 30) => Array.from({ length: seconds * hz + 1 }, (_, i) => i / hz);

const drone = (at: Vec3, roll = 0): Part[] => [{ size: [0.6, 0.6, 0.14], at, roll }];

/** A body of 1.4 m with stepping feet; `squat`: how far the pelvis is lowered, `lift`: the height above the floor. */
function humanoid(t: number, { speed = 0, squat = 0, lift = 0, arms = 0 } = {}): Part[] {
  const phase = 2 * Math.PI * t * (speed > 0 ? 1.8 : 0);
  const [x, bob, sway] = [
    speed * t,
    speed > 0 ? 0.02 * Math.cos(2 * phase) : 0,
    speed > 0 ? 0.03 * Math.sin(phase) : 0,
  ];
  const top = 1.4 - squat + lift + bob;
  return [
    { size: [0.25, 0.5, 0.7 - squat / 2], at: [x, sway, top - (0.7 - squat / 2) / 2] },
    {
      size: [0.26, 0.1, 0.08],
      at: [x + 0.25 * Math.sin(phase), 0.1, 0.04 + lift + 0.05 * Math.max(0, Math.cos(phase))],
    },
    {
      size: [0.26, 0.1, 0.08],
      at: [x - 0.25 * Math.sin(phase), -0.1, 0.04 + lift + 0.05 * Math.max(0, -Math.cos(phase))],
    },
    { size: [0.1, 0.1, 0.6], at: [x + 0.1 * Math.sin(phase), 0.25, top - 0.5 + arms] },
  ];
}

describe.each(PICTURES)('the whole body in a picture of %i × %i', (...picture) => {
  it('a drone that climbs 30 m, tilts and lands is in the picture at every moment, in the middle while it hovers', () => {
    const rig = rigOf(drone([0, 0, 0.07]), picture);
    const rest = rig.target[2];
    for (const t of times(10))
      expect(reach(rig, drone([0, 0, 0.07 + 3 * t], 0.4 * Math.sin(t)))).toBeLessThan(1);
    expect(reach(rig, drone([0, 0, 30]))).toBeLessThan(0.8);
    expect(rig.target[2]).toBeCloseTo(30, 1);
    expect(reach(rig, drone([8, 3, 12]))).toBeLessThan(1); // another sample, far away
    for (const t of times(4)) expect(reach(rig, drone([8, 3, 12.07 - 3 * t]))).toBeLessThan(1);
    expect(rig.target[2], 'as before it rose').toBeCloseTo(rest, 9);
  });

  it('a car that rolls over its nose and its side is in the picture at every moment', () => {
    const car = (t: number): Part[] => {
      const roll = 2 * t;
      const up = Math.abs(2.1 * Math.sin(roll)) + Math.abs(0.7 * Math.cos(roll));
      return [{ size: [4.2, 1.8, 1.4], at: [3 * t, 0, up], roll, yaw: 0.7 * t }];
    };
    const rig = rigOf(car(0), picture);
    for (const t of times(8)) expect(reach(rig, car(t)), `${t} s`).toBeLessThan(1);
  });

  it('a snake that stretches away from its root is in the picture at every moment', () => {
    const snake = (t: number): Part[] =>
      Array.from({ length: 30 }, (_, i) => {
        const bent = Math.max(0, 1 - t / 3) * 0.25 * i;
        return {
          size: [0.1, 0.05, 0.05],
          at: [0.1 * i * Math.cos(bent), 0.1 * i * Math.sin(bent), 0.03] as const,
        };
      });
    const rig = rigOf(snake(0), picture);
    for (const t of times(3)) expect(reach(rig, snake(t)), `${t} s`).toBeLessThan(1);
  });

  it('a humanoid that jumps or lifts its arms is in the picture; the camera is back where it was', () => {
    const rig = rigOf(humanoid(0), picture);
    const rest = rig.target[2];
    for (const t of times(1)) expect(reach(rig, humanoid(t, { lift: 1.6 * t * (1 - t) }))).toBeLessThan(1);
    expect(rig.target[2]).toBeCloseTo(rest, 9);
    for (const t of times(1)) expect(reach(rig, humanoid(t, { arms: 0.7 * t }))).toBeLessThan(1);
    rig.look('home', false);
    expect(reach(rig, humanoid(0))).toBeLessThan(1);
  });

  it('a humanoid that walks or squats moves the camera’s height by nothing, and its distance', () => {
    const rig = rigOf(humanoid(0), picture);
    const { position } = rig;
    for (const t of times(6)) {
      expect(reach(rig, humanoid(t, { speed: 0.6 }))).toBeLessThan(1);
      expect(rig.position[2]).toBe(position[2]);
    }
    const still = rig.position;
    for (const t of times(2))
      expect(reach(rig, humanoid(6, { speed: 0.6, squat: 0.45 * Math.sin(t) }))).toBeLessThan(1);
    expect(rig.position).toEqual(still);
  });

  it('one that hovers and sways a little moves nothing', () => {
    const rig = rigOf(drone([0, 0, 0.07]), picture);
    reach(rig, drone([0, 0, 20]));
    rig.frame([-0.3, -0.3, 19.93], [0.3, 0.3, 20.07]);
    const { position } = rig;
    for (const t of times(4)) expect(reach(rig, drone([0, 0, 20 + 0.02 * Math.sin(3 * t)]))).toBeLessThan(1);
    expect(rig.position).toEqual(position);
  });
});

it('a height that is no number, or a joint read as a kilometre, does not send the camera away for good', () => {
  const rig = rigOf(humanoid(0), [860, 640]);
  const home = rig.position;
  rig.follow(0, 0, 0, spanOf([placed({ size: [1, 1, 1], at: [0, 0, Number.NaN] })]));
  expect(rig.position).toEqual(home);
  const torn = [...humanoid(0), { size: [1, 1, 1], at: [0, 0, 1000] } as const];
  rig.follow(0, 0, 0, spanOf(torn.map(placed)));
  expect(rig.position.every(Number.isFinite)).toBe(true);
  expect(Math.hypot(...rig.position.map((value, axis) => value - rig.target[axis]!))).toBeLessThan(30);
  reach(rig, humanoid(0));
  rig.look('home', false);
  for (const axis of [0, 1, 2]) expect(rig.position[axis]).toBeCloseTo(home[axis]!, 1);
});

it('what somebody has chosen stays: distance and direction, while the height goes along', () => {
  const rig = rigOf(drone([0, 0, 0.07]), [860, 640]);
  rig.orbit(0.4, 0.2);
  rig.zoom(0.6);
  const before = rig.position.map((value, axis) => value - rig.target[axis]!);
  const longer = [...drone([0, 0, 10]), { size: [0.02, 0.02, 3], at: [0, 0, 9] } as const];
  rig.follow(0, 0, 0, spanOf(longer.map(placed)));
  const after = rig.position.map((value, axis) => value - rig.target[axis]!);
  for (const axis of [0, 1, 2]) expect(after[axis]).toBeCloseTo(before[axis]!, 9);
  expect(rig.target[2]).toBeGreaterThan(8);
  rig.followMode = 'stay';
  const stays = rig.position;
  rig.follow(0, 0, 0, spanOf(drone([0, 0, 20]).map(placed)));
  expect(rig.position).toEqual(stays);
});
