/** A built model on disk, and the equivalent URDF for other programs. */

import { createHash } from 'node:crypto';
import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { type SampleModel, sampleGlb, sampleManifest } from '../tests/rigs/model_samples.ts';

export interface BuiltFiles {
  readonly folder: string;
  readonly urdf: string;
}

/** Writes manifest, levels and `robot.urdf` into a folder. */
export async function writeBuilt(
  folder: string,
  model: SampleModel,
  levels: readonly string[] = ['low', 'middle', 'high'],
): Promise<BuiltFiles> {
  const listed = [];
  for (const name of levels) {
    const bytes = await sampleGlb(model, name);
    const file = `${name}.glb`;
    writeFileSync(path.join(folder, file), bytes);
    listed.push({
      name,
      path: file,
      bytes: bytes.length,
      sha256: createHash('sha256').update(bytes).digest('hex'),
    });
  }
  writeFileSync(path.join(folder, 'manifest.json'), JSON.stringify(sampleManifest(model, listed)));
  const urdf = path.join(folder, 'robot.urdf');
  writeFileSync(urdf, urdfOf(model));
  return { folder, urdf };
}

/** Rotations are only about z, so that a quaternion is easily converted to roll, pitch and yaw. */
function urdfOf({ joints, visuals }: SampleModel): string {
  const link = (i: number) => (i === 0 ? 'base' : `link${i}`);
  const links = Array.from({ length: joints.length + 1 }, (_, i) => {
    const shown = visuals
      .filter((visual) => visual.link === i)
      .map(
        ({ at = [0, 0, 0], size = [0.2, 0.2, 0.2] }) =>
          `<visual><origin xyz="${at.join(' ')}"/><geometry><box size="${size.join(' ')}"/></geometry></visual>`,
      );
    return `<link name="${link(i)}">${shown.join('')}</link>`;
  });
  const lines = joints.map(
    ({ type, parent, xyz = [0, 0, 0], quat = [1, 0, 0, 0], axis = [0, 0, 1], mimic }, i) => {
      const yaw = 2 * Math.atan2(quat[3]!, quat[0]!);
      const follows =
        mimic === undefined
          ? ''
          : `<mimic joint="joint${mimic.joint + 1}" multiplier="${mimic.multiplier ?? 1}" offset="${mimic.offset ?? 0}"/>`;
      return (
        `<joint name="joint${i + 1}" type="${type}"><parent link="${link(parent)}"/><child link="${link(i + 1)}"/>` +
        `<origin xyz="${xyz.join(' ')}" rpy="0 0 ${yaw}"/><axis xyz="${axis.join(' ')}"/>` +
        `<limit lower="-9" upper="9" effort="1" velocity="1"/>${follows}</joint>`
      );
    },
  );
  return `<robot name="sample">${links.join('')}${lines.join('')}</robot>`;
}

/** A leg-like chain with branches: `parts` visuals on as many links, every kind of joint that moves. */
export function sampleChain(parts: number): SampleModel {
  const kinds = ['revolute', 'continuous', 'prismatic', 'fixed', 'revolute'] as const;
  const axes = [
    [0, 1, 0],
    [1, 0, 0],
    [0, 0, 1],
  ] as const;
  const joints = Array.from({ length: parts - 1 }, (_, i) => {
    const yaw = 0.3 * Math.sin(i);
    return {
      type: kinds[i % kinds.length]!,
      parent: Math.max(0, i - (i % 4)),
      xyz: [0.12 * Math.cos(i), 0.12 * Math.sin(i), 0.06] as const,
      quat: [Math.cos(yaw / 2), 0, 0, Math.sin(yaw / 2)] as const,
      axis: axes[i % 3]!,
      ...(i === 4 ? { mimic: { joint: 0, multiplier: -0.5, offset: 0.1 } } : {}),
    };
  });
  return {
    joints,
    visuals: Array.from({ length: parts }, (_, link) => ({
      link,
      size: [0.1, 0.06 + 0.01 * (link % 3), 0.08] as const,
      material: link % 3,
    })),
    materials: [{ color: [0.6, 0.1, 0.1, 1] }, { color: [0.1, 0.3, 0.6, 1] }, { color: [0.6, 0.6, 0.6, 1] }],
  };
}
