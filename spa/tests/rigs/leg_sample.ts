import { Color } from 'three';
import type { Manifest } from '../../src/model/manifest.ts';
import { SkinnedRobot } from '../../src/scene/three/skinned_robot.ts';
import { StaleEffect } from '../../src/scene/three/stale_effect.ts';

const WHOLE = { xyz: [0, 0, 0], quat: [1, 0, 0, 0], limits: null, mimic: null } as const;

/** A leg for tests: hip, thigh, shank and foot, 1 m tall, with its foot on the floor; hip and knee bend about y. */
export function sampleLeg(): SkinnedRobot {
  const box = (min: [number, number, number], max: [number, number, number]) => ({ min, max });
  const manifest = {
    links: ['hip', 'thigh', 'shank', 'foot'],
    joints: [
      { ...WHOLE, name: 'hip_pitch', type: 'revolute', parent: 0, axis: [0, 1, 0] },
      { ...WHOLE, name: 'knee', type: 'revolute', parent: 1, axis: [0, 1, 0], xyz: [0, 0, -0.5] },
      { ...WHOLE, name: 'sole', type: 'fixed', parent: 2, axis: [1, 0, 0], xyz: [0, 0, -0.45] },
    ],
    visuals: [
      { link: 1, box: box([-0.05, -0.05, -0.5], [0.05, 0.05, 0]) },
      { link: 2, box: box([-0.05, -0.05, -0.45], [0.05, 0.05, 0]) },
      { link: 3, box: box([-0.1, -0.05, -0.05], [0.15, 0.05, 0]) },
    ],
    levels: [],
    missing: [],
  } as unknown as Manifest;
  const tone = { value: new Color() };
  const leg = new SkinnedRobot(manifest, new StaleEffect(new Color()), { accent: tone, caution: tone });
  leg.ground();
  return leg;
}
