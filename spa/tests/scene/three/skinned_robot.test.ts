import { Color } from 'three';
import { describe, expect, it } from 'vitest';
import { readLod } from '../../../src/model/lod.ts';
import { readManifest } from '../../../src/model/manifest.ts';
import type { Skin } from '../../../src/scene/three/skin.ts';
import { SkinnedRobot } from '../../../src/scene/three/skinned_robot.ts';
import { StaleEffect } from '../../../src/scene/three/stale_effect.ts';
import { jointsAt } from '../../rigs/joints.ts';
import { type SampleModel, sampleGlb, sampleManifest } from '../../rigs/model_samples.ts';

const tones = { accent: { value: new Color() }, caution: { value: new Color() } };
const UPRIGHT = [1, 0, 0, 0] as const;

/** A chain of revolute joints, with a box on each link. */
function chain(joints: number): SampleModel {
  return {
    joints: Array.from({ length: joints }, (_, parent) => ({
      type: 'revolute',
      parent,
      xyz: [0, 0, 0.1],
      axis: [0, 1, 0],
    })),
    visuals: Array.from({ length: joints + 1 }, (_, link) => ({ link })),
  };
}

function robotOf(model: SampleModel): SkinnedRobot {
  return new SkinnedRobot(
    readManifest(sampleManifest(model, []) as never),
    new StaleEffect(new Color()),
    tones,
  );
}

const levelOf = async (model: SampleModel) => readLod(await sampleGlb(model), model.visuals.length);
type Drawn = Skin['mesh'];

describe('a skinned robot', () => {
  it('puts links where the joints say, before it has shells', () => {
    const robot = robotOf(chain(2));
    robot.setJoints(jointsAt({ joint1: Math.PI / 2 }));
    robot.place([1, 2, 3], UPRIGHT);
    const [x, y, z] = robot.linkMatrix('link2')!.elements.slice(12, 15);
    expect([x, y, z].map((value) => Number(value?.toFixed(9)))).toEqual([1.1, 2, 3.1]);
    expect(robot.root.children).toEqual([]);
  });

  it('changes its shells without a gap: one mesh before, one after', async () => {
    const model = chain(2);
    const robot = robotOf(model);
    robot.wear(await levelOf(model), []);
    const [first] = robot.root.children as Drawn[];
    robot.wear(await levelOf(model), []);
    expect(robot.root.children.length).toBe(1);
    expect(robot.root.children[0]).not.toBe(first);
  });

  it('lends its shells to a ghost, which goes along when they change and stands in a pose of its own', async () => {
    const model = chain(2);
    const robot = robotOf(model);
    const ghost = robot.ghost();
    expect(ghost.mesh.visible, 'nothing to wear yet').toBe(false);
    robot.wear(await levelOf(model), []);
    const shells = () => robot.root.children.find((child) => child !== ghost.mesh) as Drawn;
    expect(ghost.mesh.visible).toBe(true);
    expect(ghost.mesh.geometry, 'the very buffers').toBe(shells().geometry);
    robot.wear(await levelOf(model), []);
    expect(ghost.mesh.geometry).toBe(shells().geometry);
    expect(ghost.setJoints(jointsAt({ joint1: 1 }))).toBe(true);
    expect(ghost.setJoints(jointsAt({ joint1: 1 }))).toBe(false);
    robot.place([0, 0, 0], UPRIGHT);
    expect(robot.linkMatrix('link2')!.elements[14]).toBeCloseTo(0.2, 9);
    expect(ghost.rootFromLink[2 * 16 + 14]).toBeCloseTo(0.1 + 0.1 * Math.cos(1), 9);
    ghost.dispose();
    expect(robot.root.children).toEqual([shells()]);
    robot.dispose();
  });

  it('tells what it costs to apply 60 joints and to place 60 links and shells', async () => {
    const model = chain(60);
    const robot = robotOf(model);
    robot.wear(await levelOf(model), []);
    const names = robot.jointNames;
    const readings = { names, values: new Float64Array(names.length) };
    let best = Number.POSITIVE_INFINITY;
    for (let repeat = 0; repeat < 9; repeat += 1) {
      const began = performance.now();
      for (let round = 0; round < 200; round += 1) {
        readings.values.fill(Math.sin(round + repeat));
        robot.setJoints(readings);
        robot.ground();
      }
      best = Math.min(best, (performance.now() - began) / 200);
    }
    console.info(`apply and matrices of a skinned robot of 60 joints: ${best.toFixed(4)} ms`);
    expect(names.length).toBe(60);
  });
});
