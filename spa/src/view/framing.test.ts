// @vitest-environment happy-dom
import { Box3, Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { extentOf } from '../model/bounds.ts';
import { CameraRig } from '../three/camera.ts';
import { FIELD_OF_VIEW, fittingDistance } from './framing.ts';
import { homeEye } from './stick_figure.ts';

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

  it('of a speck or a mountain stays at a distance that can be drawn', () => {
    expect(extentOf([0, 0, 0], [0, 0, 0]).radius).toBe(0.02);
    expect(extentOf([-1e6, 0, 0], [1e6, 0, 0]).radius).toBe(200);
  });

  it('is the same for the sketch and for the camera: nothing jumps', () => {
    const canvas = document.createElement('canvas');
    const rig = new CameraRig(canvas, () => {});
    rig.resize(1000, 700);
    const [min, max] = [
      [-0.2, -0.5, 0],
      [0.4, 0.5, 1.6],
    ] as const;
    rig.frame(new Box3(new Vector3(...min), new Vector3(...max)));
    rig.camera.updateMatrixWorld();
    const eye = homeEye(min, max, 1000 / 700);
    const at = eye.target.map((value, axis) => value - eye.ahead[axis]! * eye.distance);
    for (const [axis, value] of rig.camera.position.toArray().entries())
      expect(at[axis]).toBeCloseTo(value, 9);
    const across = new Vector3().setFromMatrixColumn(rig.camera.matrixWorld, 0).toArray();
    for (const [axis, value] of across.entries()) expect(eye.right[axis]).toBeCloseTo(value, 9);
    rig.dispose();
  });
});
