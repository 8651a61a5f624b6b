// @vitest-environment happy-dom
import { Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { extentOf } from '../../../src/model/bounds.ts';
import {
  directionOf,
  FIELD_OF_VIEW,
  fittingDistance,
  leastDistance,
  VIEWS,
} from '../../../src/scene/camera/framing.ts';
import { homeEye } from '../../../src/scene/figure/stick_figure.ts';
import { SceneCamera } from '../../../src/scene/three/camera.ts';

describe('the first view', () => {
  it('has all of the robot in the picture, wide or upright', () => {
    for (const aspect of [2, 1, 0.46]) {
      const extent = extentOf([-0.3, -0.9, 0], [0.3, 0.9, 1.7]);
      const slope = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
      const distance = fittingDistance(extent, aspect);
      expect(distance * slope).toBeGreaterThan(extent.tall);
      expect(distance * slope * aspect).toBeGreaterThan(extent.wide);
    }
  });

  it('is nearer in a picture that is low in pixels, and still has all of the robot', () => {
    const extent = extentOf([-0.3, -0.9, 0], [0.3, 0.9, 1.7]);
    for (const aspect of [2, 1, 0.46]) {
      const [low, middle, high] = [200, 430, 800].map((px) => fittingDistance(extent, aspect, px));
      expect(low).toBeGreaterThanOrEqual(leastDistance(extent.tall, extent.wide, aspect));
      expect(low).toBeLessThanOrEqual(middle!);
      expect(middle).toBeLessThanOrEqual(high!);
      expect(high).toBe(fittingDistance(extent, aspect));
    }
    expect(fittingDistance(extent, 2, 200)).toBeLessThan(0.93 * fittingDistance(extent, 2, 800));
  });

  it('of a long body is taken across its length, and fills the picture', () => {
    for (const [max, lies, azimuth] of [
      [[9, 0.1, 0.1], 'x', -75],
      [[0.1, 9, 0.1], 'y', -15],
    ] as const) {
      const extent = extentOf([0, 0, 0], max);
      expect(extent.lies).toBe(lies);
      expect(directionOf('home', extent).azimuth).toBe(azimuth);
      const seen = 4.5 * Math.cos((15 * Math.PI) / 180); // half of it, as it is seen
      const half = fittingDistance(extent, 1.6) * Math.tan((FIELD_OF_VIEW * Math.PI) / 360) * 1.6;
      expect(seen / half).toBeGreaterThan(0.75);
      expect(seen / half).toBeLessThan(0.95);
    }
    const upright = extentOf([-0.2, -0.5, 0], [0.4, 0.5, 1.6]);
    expect(upright.lies).toBeUndefined();
    expect(directionOf('home', upright)).toEqual(VIEWS.home);
    expect(directionOf('top', extentOf([0, 0, 0], [9, 0.1, 0.1]))).toEqual(VIEWS.top);
  });

  it('of a speck or a mountain stays at a distance that can be drawn', () => {
    expect(extentOf([0, 0, 0], [0, 0, 0]).radius).toBe(0.02);
    expect(extentOf([-1e6, 0, 0], [1e6, 0, 0]).radius).toBe(200);
  });

  it('is the same for the sketch and for the camera: nothing jumps', () => {
    const canvas = document.createElement('canvas');
    const { rig, camera } = new SceneCamera(canvas, () => {});
    rig.resize(1000, 700);
    const [min, max] = [
      [-0.2, -0.5, 0],
      [0.4, 0.5, 1.6],
    ] as const;
    rig.frame(min, max);
    camera.updateMatrixWorld();
    const eye = homeEye(min, max, 1000 / 700);
    const at = eye.target.map((value, axis) => value - eye.ahead[axis]! * eye.distance);
    for (const [axis, value] of camera.position.toArray().entries()) expect(at[axis]).toBeCloseTo(value, 9);
    const across = new Vector3().setFromMatrixColumn(camera.matrixWorld, 0).toArray();
    for (const [axis, value] of across.entries()) expect(eye.right[axis]).toBeCloseTo(value, 9);
  });
});
