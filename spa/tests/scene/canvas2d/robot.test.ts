import { beforeAll, describe, expect, it } from 'vitest';
import { lowestZ } from '../../../src/model/bounds.ts';
import { type Lod, readLod } from '../../../src/model/lod.ts';
import { type Manifest, readManifest } from '../../../src/model/manifest.ts';
import { CameraRig } from '../../../src/scene/camera/camera_rig.ts';
import { LIGHT_COLORS } from '../../../src/scene/canvas2d/colors.ts';
import { Rasterizer } from '../../../src/scene/canvas2d/rasterizer.ts';
import { LightRobot } from '../../../src/scene/canvas2d/robot.ts';
import { LightRobotNode } from '../../../src/scene/canvas2d/robot_node.ts';
import type { Pose } from '../../../src/twin/playback/pose.ts';
import { type JointValues, NO_JOINTS } from '../../../src/twin/playback/pose.ts';
import { IDENTITY, type Quat, quatOfRpy } from '../../../src/twin/rotation.ts';
import { jointsAt } from '../../rigs/joints.ts';
import { type SampleModel, sampleGlb, sampleManifest } from '../../rigs/model_samples.ts';

/** An arm of two boxes, one beside the other: red, then blue, the second on a joint about z. */
const ARM: SampleModel = {
  joints: [{ type: 'revolute', parent: 0, xyz: [0, 0.5, 0], axis: [0, 0, 1] }],
  visuals: [
    { link: 0, at: [0, 0, 0.2], size: [0.3, 0.3, 0.4], material: 0 },
    { link: 1, at: [0, 0, 0.2], size: [0.3, 0.3, 0.4], material: 1 },
  ],
  materials: [{ color: [0.8, 0.02, 0.02, 1] }, { color: [0.02, 0.02, 0.8, 1] }],
};

const [WIDTH, HEIGHT] = [320, 240];

async function built(model: SampleModel): Promise<{ manifest: Manifest; level: Lod }> {
  const manifest = readManifest(sampleManifest(model, []) as Record<string, unknown>);
  return { manifest, level: await readLod(await sampleGlb(model), model.visuals.length) };
}

function pictured(robot: LightRobot) {
  const eye = new CameraRig();
  eye.resize(WIDTH, HEIGHT);
  const { min, max } = robot.bounds();
  eye.frame(min, max, false);
  eye.look('front', false);
  const raster = new Rasterizer();
  raster.resize(WIDTH, HEIGHT);
  raster.clear();
  const view = eye.screenFromWorld();
  const triangles = robot.draw(raster, view);
  let [red, blue, grey] = [0, 0, 0];
  for (const pixel of raster.pixels) {
    const [r, b] = [pixel & 255, (pixel >> 16) & 255];
    if (pixel === 0) continue;
    if (r > b + 40) red += 1;
    else if (b > r + 40) blue += 1;
    else grey += 1;
  }
  return { triangles, red, blue, grey, raster, view, eye };
}

/** A robot posed through its node; each entry of changes is true if the node reported something new to draw. */
function staged(robot: LightRobot) {
  let told = 0;
  const tell = () => {
    told += 1;
  };
  class Posed extends LightRobotNode {
    constructor() {
      super({ tones: () => LIGHT_COLORS.dark, placed: tell, framed: tell, changed: tell });
      this.adopt(robot);
    }
  }
  const node = new Posed();
  const tells = (work: () => void) => {
    told = 0;
    work();
    return told > 0;
  };
  return {
    node,
    setPose: (pose: Pose) => tells(() => node.setPose(pose, true)),
    showGhost: (joints: JointValues | null, limbs: readonly string[] | null = null) =>
      tells(() => node.showGhost(joints, limbs)),
    lockHeading: (locked: boolean) => tells(() => node.lockHeading(locked)),
  };
}

describe('a robot drawn by hand', () => {
  let arm: { manifest: Manifest; level: Lod };
  beforeAll(async () => {
    arm = await built(ARM);
  });
  const dressed = () => {
    const robot = new LightRobot(arm.manifest, LIGHT_COLORS.dark);
    robot.wear(arm.level, []);
    return robot;
  };
  const joint = () => arm.manifest.joints[0]!.name;
  const [first, second] = [0, 1];
  const link = (i: number) => arm.manifest.links[i]!;

  it('shows its links in their colours, and nothing before it has shells', () => {
    expect(pictured(new LightRobot(arm.manifest, LIGHT_COLORS.dark)).triangles).toBe(0);
    const { triangles, red, blue, grey } = pictured(dressed());
    expect(triangles).toBe(24); // all faces of two boxes: the far sides are hidden, not left out
    expect(red).toBeGreaterThan(500);
    expect(blue).toBeGreaterThan(500);
    expect(grey).toBe(0);
  });

  it('picks the link under a pixel', () => {
    const robot = dressed();
    const { raster, view } = pictured(robot);
    for (const [isRed, name] of [
      [true, link(first)],
      [false, link(second)],
    ] as const) {
      const at = raster.pixels.findIndex(
        (pixel) => pixel !== 0 && (pixel & 255) > ((pixel >> 16) & 255) === isRed,
      );
      expect(robot.pick((at % WIDTH) + 0.5, Math.floor(at / WIDTH) + 1.5, view)).toBe(name);
    }
    expect(robot.pick(1, 1, view)).toBeNull();
    robot.setLook(link(first), { hide: true });
    const { raster: without, red } = pictured(robot);
    expect(red).toBe(0);
    const hidden = raster.pixels.findIndex((pixel, i) => pixel !== 0 && without.pixels[i] === 0);
    expect(robot.pick((hidden % WIDTH) + 0.5, Math.floor(hidden / WIDTH) + 1.5, view)).toBeNull();
  });

  it('lets half of a link be seen through', () => {
    const robot = dressed();
    const { red } = pictured(robot);
    robot.setLook(link(first), { fade: 0.5 });
    expect(pictured(robot).red / red).toBeCloseTo(0.5, 1);
    expect(robot.setLook('nobody', { hide: true })).toBe(false);
  });

  it('moves with its joints and says so only when something changed', () => {
    const robot = dressed();
    const { node, setPose } = staged(robot);
    const at = (angle: number) => ({ joints: jointsAt({ [joint()]: angle }), base: null });
    expect(setPose(at(0.4))).toBe(true);
    expect(setPose(at(0.4))).toBe(false);
    expect(node.linkPoses()[link(second)]!.slice(0, 2)).toEqual(
      [Math.cos(0.4), -Math.sin(0.4)].map((v) => expect.closeTo(v)),
    );
    expect(setPose({ joints: NO_JOINTS, base: { xyz: [1, 2, 3], quat_wxyz: [1, 0, 0, 0] } })).toBe(true);
    expect([3, 7, 11].map((i) => node.linkPoses()[link(first)]![i])).toEqual([1, 2, 3]);
    expect(
      setPose({
        joints: jointsAt({ [joint()]: Number.NaN }),
        base: { xyz: [1, 2, 3], quat_wxyz: [1, 0, 0, 0] },
      }),
    ).toBe(false);
  });

  it('marks the link of a joint without a reading, and it alone: grey, hatched, where it was', () => {
    const robot = dressed();
    const { node, setPose } = staged(robot);
    setPose({ joints: jointsAt({ [joint()]: 0.4 }), base: null });
    const before = node.linkPoses();
    const lost = { joints: NO_JOINTS, base: null, unread: new Set([joint()]) };
    expect(setPose(lost)).toBe(true);
    expect(setPose(lost)).toBe(false);
    expect(node.linkPoses()).toEqual(before);
    const { red, blue, grey } = pictured(robot);
    expect(red).toBeGreaterThan(500);
    expect(blue).toBe(0);
    expect(grey).toBeGreaterThan(500);
    expect(setPose({ joints: jointsAt({ [joint()]: 0.4 }), base: null, unread: new Set() })).toBe(true);
    expect(pictured(robot).grey).toBe(0);
  });

  it('takes the colours of load, striped past a limit, and gives them back', () => {
    const robot = dressed();
    robot.setTint(link(first), { color: 0x2020d0, hatched: false });
    const { red, blue } = pictured(robot);
    expect(red).toBe(0);
    const striped = { color: 0x2020d0, hatched: true };
    robot.setTint(link(first), striped);
    const pixels = (of: LightRobot) => new Set(pictured(of).raster.pixels).size;
    const shades = pixels(robot);
    robot.setTint(link(first), { ...striped, hatched: false });
    expect(shades).toBeGreaterThan(pixels(robot));
    expect(pictured(robot).blue).toBe(blue);
    robot.setTint(link(first), null);
    expect(pictured(robot).red).toBeGreaterThan(500);
  });

  it('has a ghost of the limbs that are elsewhere, before and behind its body, and see-through', () => {
    const robot = dressed();
    const { node, showGhost } = staged(robot);
    const { raster, view, eye } = pictured(robot);
    const glass = new Rasterizer();
    expect(robot.drawGhost(glass, view, eye.position), 'none is asked for').toBe(0);
    const wish = [jointsAt({ [joint()]: 1.2 }), [joint()]] as const;
    expect(showGhost(...wish)).toBe(true);
    expect(showGhost(...wish)).toBe(false);
    expect(node.ghostLinks).toEqual([link(second)]);
    glass.clearBefore(raster);
    expect(robot.drawGhost(glass, view, eye.position)).toBe(12);
    const seen = [...glass.pixels].filter((pixel) => pixel !== 0);
    expect(seen.length).toBeGreaterThan(100);
    expect(seen.every((pixel) => pixel >>> 24 < 255)).toBe(true);
    const before = raster.pixels.slice();
    raster.overlay(glass);
    const changed = raster.pixels.filter((pixel, i) => pixel !== before[i]);
    expect(changed.length).toBe(seen.length);
    expect(showGhost(null)).toBe(true);
    expect(node.ghostLinks).toEqual([]);
  });

  it('where its ghost stands as it does, shows itself', () => {
    const robot = dressed();
    const { showGhost } = staged(robot);
    const { raster, view, eye } = pictured(robot);
    showGhost(NO_JOINTS);
    const glass = new Rasterizer();
    glass.clearBefore(raster);
    robot.drawGhost(glass, view, eye.position);
    expect(glass.pixels.every((pixel) => pixel === 0)).toBe(true);
  });

  it('without a base leans as its IMU says, keeps that when it falls silent, and may face ahead always', () => {
    const robot = dressed();
    const { node, setPose, lockHeading } = staged(robot);
    const lean = (worldFromSensor: Quat | null) => ({
      joints: NO_JOINTS,
      base: null,
      lean: {
        ...{ site: 'torso', name: 'torso', link: null, linkFromSensor: IDENTITY, xyz: [0, 0, 0] as const },
        ...{ heading: true, worldFromSensor },
      },
    });
    expect(setPose(lean(quatOfRpy([0.2, 0, 0.7])))).toBe(true);
    const up = () => node.linkPoses()[link(first)]![10];
    expect(up()).toBeCloseTo(Math.cos(0.2));
    expect(node.heading).toBeCloseTo(0.7);
    const low = robot.boxes.map(([placed, box]) => lowestZ(box, placed.matrixWorld.elements));
    expect(Math.min(...low), 'it stands on the floor').toBeCloseTo(0);
    expect(setPose(lean(null))).toBe(false);
    expect(up()).toBeCloseTo(Math.cos(0.2));
    expect(lockHeading(true)).toBe(true);
    expect(node.heading).toBeCloseTo(0);
  });

  it('of 200 joints is drawn whole', async () => {
    const many = await built({
      joints: Array.from({ length: 200 }, (_, parent) => ({
        type: 'revolute',
        parent,
        xyz: [0, 0.03, 0.01],
      })),
      visuals: Array.from({ length: 201 }, (_, i) => ({
        link: i,
        size: [0.05, 0.02, 0.05] as const,
        mesh: 1,
      })),
      materials: [{ color: [0.8, 0.02, 0.02, 1] }],
    });
    const robot = new LightRobot(many.manifest, LIGHT_COLORS.light);
    robot.wear(many.level, []);
    const { setPose } = staged(robot);
    expect(robot.jointNames.length).toBe(200);
    expect(
      setPose({
        joints: jointsAt(Object.fromEntries(robot.jointNames.map((name, i) => [name, 0.02 * (i % 5)]))),
        base: null,
      }),
    ).toBe(true);
    expect(pictured(robot).triangles).toBeGreaterThan(201 * 6);
  });
});
