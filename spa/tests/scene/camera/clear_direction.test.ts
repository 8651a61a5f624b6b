import { describe, expect, it } from 'vitest';
import { transform } from '../../../src/model/kinematics.ts';
import type { PlacedBox } from '../../../src/model/posed_body.ts';
import { clearDirection, type Sight } from '../../../src/scene/camera/clear_direction.ts';
import type { Vec3 } from '../../../src/twin/rotation.ts';

const RADIANS = Math.PI / 180;

/** A camera at the robot's front right, three metres away. */
const SIGHT: Sight = {
  from: { azimuth: -45 * RADIANS, elevation: 14 * RADIANS, distance: 3 },
  reach: 0.75,
  lowest: 0,
  highest: 1.57,
};

/** A box between two corners (metres, world), as a link whose frame is aligned with the world's. */
function box(min: Vec3, max: Vec3): PlacedBox {
  const half = min.map((low, axis) => (max[axis]! - low) / 2) as [number, number, number];
  const at = min.map((low, axis) => low + half[axis]!) as unknown as Vec3;
  const link = { matrixWorld: { elements: transform(at, [1, 0, 0, 0]) } };
  return [link, { min: half.map((metres) => -metres) as [number, number, number], max: half }];
}

const TRUNK = box([-0.12, -0.2, 0.6], [0.12, 0.2, 1.2]);
const LEFT_HAND: Vec3 = [0, 0.35, 0.8];

/** In degrees. */
function found(point: Vec3, boxes: readonly PlacedBox[], sight = SIGHT) {
  const { azimuth, elevation } = clearDirection(point, boxes, sight);
  return { azimuth: Math.round(azimuth / RADIANS), elevation: Math.round(elevation / RADIANS) };
}

describe('the direction from which a joint is seen', () => {
  it('is the present one where nothing is in between, whatever stands behind the joint or behind the camera', () => {
    const behind = box([-1, 0.5, 0], [0, 1, 2]);
    const far = box([4, -5, 0], [5, -4, 2]);
    expect(found(LEFT_HAND, [])).toEqual({ azimuth: -45, elevation: 14 });
    expect(found(LEFT_HAND, [behind, far])).toEqual({ azimuth: -45, elevation: 14 });
  });

  it('is the nearest one that is free where the trunk hides the joint', () => {
    const side = { ...SIGHT, from: { ...SIGHT.from, azimuth: -90 * RADIANS } };
    const free = clearDirection(LEFT_HAND, [TRUNK], side);
    expect(free).not.toEqual(side.from);
    const there = { ...side, from: { ...side.from, ...free } };
    expect(clearDirection(LEFT_HAND, [TRUNK], there), 'it is free').toBe(there.from);
    const tall = box([-0.12, -0.2, 0], [0.12, 0.2, 3]);
    expect(Math.abs(found(LEFT_HAND, [tall], side).azimuth + 90)).toBe(60);
  });

  it('does not depend on how the links are turned', () => {
    const [, { min, max }] = TRUNK;
    const quarter = Math.SQRT1_2;
    // the same box, as a link rotated by a quarter turn about z
    const turned: PlacedBox = [
      { matrixWorld: { elements: transform([0, 0, 0.9], [quarter, 0, 0, quarter]) } },
      { min: [min[1], -max[0], min[2]], max: [max[1], -min[0], max[2]] },
    ];
    const side = { ...SIGHT, from: { ...SIGHT.from, azimuth: -100 * RADIANS } };
    expect(found(LEFT_HAND, [turned], side)).toEqual(found(LEFT_HAND, [TRUNK], side));
  });

  it('of a joint inside the trunk leads out of it the short way', () => {
    const shoulder: Vec3 = [0, 0.18, 1.05];
    const behind = { ...SIGHT, from: { ...SIGHT.from, azimuth: -120 * RADIANS } };
    const { azimuth } = found(shoulder, [TRUNK], behind);
    expect(Math.sin(azimuth * RADIANS)).toBeGreaterThan(0.4); // from its left
    expect(
      found(shoulder, [TRUNK], { ...SIGHT, from: { ...SIGHT.from, azimuth: 80 * RADIANS } }).azimuth,
    ).toBe(80);
  });

  it('is the least hidden one, the same each time, where all are', () => {
    const cage = [box([-1, -1, -1], [1, 1, 2]), box([-0.2, -3, -1], [0.2, 3, 3])];
    const first = found([0, 0, 0.5], cage);
    expect(found([0, 0, 0.5], cage)).toEqual(first);
    expect(Math.abs(Math.cos(first.azimuth * RADIANS))).toBeGreaterThan(0.5);
  });

  it('stays within the elevations of its camera, and is a number for boxes that are nowhere', () => {
    const sight = { ...SIGHT, lowest: 0.1, highest: 0.5 };
    const { elevation } = clearDirection(LEFT_HAND, [box([-2, -2, 0.75], [2, 0.3, 0.9])], sight);
    expect(elevation).toBeLessThanOrEqual(0.5);
    const nowhere = box([0, 0, Number.NaN], [1, 1, 1]);
    expect(Object.values(clearDirection(LEFT_HAND, [nowhere, TRUNK], SIGHT)).every(Number.isFinite)).toBe(
      true,
    );
  });
});
