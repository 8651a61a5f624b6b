// @vitest-environment happy-dom
import { createHash } from 'node:crypto';
import { beforeEach, expect, it, vi } from 'vitest';
import { LIGHT_COLORS } from '../../../src/scene/canvas2d/colors.ts';
import { LightRobotNode } from '../../../src/scene/canvas2d/robot_node.ts';
import type { PoseSource } from '../../../src/scene/figure/body_view.ts';
import type { Pose } from '../../../src/twin/playback/pose.ts';
import { jointsAt } from '../../rigs/joints.ts';
import { type SampleModel, sampleGlb, sampleManifest } from '../../rigs/model_samples.ts';

const ARM: SampleModel = {
  joints: [{ type: 'revolute', parent: 0, xyz: [0, 0.5, 0], axis: [0, 0, 1] }],
  visuals: [{ link: 0, at: [0, 0, 0.2], size: [0.3, 0.4, 0.4], material: 0 }],
  materials: [{ color: [0.8, 0.8, 0.8, 1] }],
};
const STANDING: Pose = { joints: jointsAt({ joint1: 0.3 }), base: null };

let turn = 0;
let shellsAway = false;
/** A new address for each test, because the page caches what it has fetched. */
let url = '';

beforeEach(async () => {
  turn += 1;
  shellsAway = false;
  url = `http://relay/${turn}/manifest.json`;
  const glb = await sampleGlb(ARM);
  const level = {
    name: 'low',
    path: 'low.glb',
    bytes: glb.length,
    sha256: createHash('sha256').update(glb).digest('hex'),
    triangles: 12,
  };
  vi.stubGlobal('fetch', async (at: string) => {
    if (at.includes('/lost/')) return new Response('', { status: 404 });
    if (at.includes('/away/') || (shellsAway && at.endsWith('.glb'))) throw new TypeError('no network');
    return at.endsWith('.json') ? Response.json(sampleManifest(ARM, [level])) : new Response(glb.slice());
  });
});

function staged() {
  const heard: string[] = [];
  const robot = new LightRobotNode({
    tones: () => LIGHT_COLORS.dark,
    placed: () => heard.push('placed'),
    framed: (eased) => heard.push(eased ? 'framed, eased' : 'framed'),
    changed: () => heard.push('changed'),
  });
  return { robot, heard };
}

it('is looked at once as lines and once in its shells', async () => {
  const { robot, heard } = staged();
  expect(robot.size).toBeNull();
  const report = await robot.load(url, () => {});
  expect(report.error).toBeUndefined();
  expect(robot.figure?.dressed).toBe(true);
  expect(heard.filter((word) => word.startsWith('framed'))).toEqual(['framed', 'framed, eased']);
  expect(robot.size?.[2]).toBeGreaterThanOrEqual(0.4);
});

it('a model that does not come stands in the report; a newer one takes the place of an older', async () => {
  const { robot } = staged();
  expect((await robot.load('http://relay/lost/manifest.json', () => {})).error).toMatch(/404|manifest/);
  expect(robot.figure).toBeNull();
  const [older, newer] = await Promise.all([robot.load(url, () => {}), robot.load(url, () => {})]);
  expect([older.error, newer.error]).toEqual(['superseded by a newer model', undefined]);
});

it('says whether what did not come may come later', async () => {
  const { robot } = staged();
  expect((await robot.load('http://relay/lost/manifest.json', () => {})).passing).toBeUndefined();
  expect(await robot.load('http://relay/away/manifest.json', () => {})).toMatchObject({
    error: 'manifest.json: no answer',
    passing: true,
  });
  shellsAway = true;
  expect(await robot.load(url, () => {})).toMatchObject({ bare: 'low.glb: no answer', passing: true });
  expect(robot.figure?.dressed).toBe(false);
  shellsAway = false;
  expect((await robot.load(url, () => {})).passing).toBeUndefined();
  expect(robot.figure?.dressed).toBe(true);
});

it('stands aside with its whole world, also with a model that comes later', async () => {
  const { robot } = staged();
  robot.standAside(2);
  await robot.load(url, () => {});
  expect(robot.figure?.spot.y).toBeCloseTo(2, 9);
  robot.standAside(-1);
  robot.setPose({ ...STANDING, base: { xyz: [0.5, 0.25, 0], quat_wxyz: [1, 0, 0, 0] } }, true);
  expect(robot.figure?.spot).toMatchObject({ x: expect.closeTo(0.5, 9), y: expect.closeTo(-0.75, 9) });
});

it('is grey until there is a pose, in colour from its first picture, and drains when it is told to, in steps', async () => {
  const { robot, heard } = staged();
  await robot.load(url, () => {});
  expect(robot.grey).toBe(1);
  robot.setPose(STANDING, true);
  expect(robot.advance(0.1, 0), 'what was never seen does not fade').toBe(false);
  expect(robot.grey).toBe(0);
  heard.length = 0;
  robot.advance(1, 0);
  expect(heard, 'nothing changes by itself').toEqual([]);
  robot.setGrey(true);
  expect(robot.advance(0.1, 0), 'more to come').toBe(true);
  expect(robot.grey).toBeCloseTo(0.4, 6);
  robot.advance(1, 0);
  expect(robot.grey).toBe(1);
  robot.setGrey(false);
  robot.advance(0.01, performance.now() + 1000);
  expect(robot.grey, 'however few pictures there were').toBe(0);
});

it('follows a source, and says when it has moved', async () => {
  const { robot, heard } = staged();
  await robot.load(url, () => {});
  let angle = 0.1;
  const source: PoseSource = {
    sample: () => angle < 0.3,
    pose: () => ({ ...STANDING, joints: jointsAt({ joint1: angle }) }),
    setContinuous: () => {},
  };
  robot.play(source);
  expect(robot.advance(1, 0)).toBe(true);
  angle = 0.3;
  heard.length = 0;
  expect(robot.advance(1, 0)).toBe(false);
  expect(heard).toEqual(['placed']);
});
