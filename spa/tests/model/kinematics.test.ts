import { readFileSync } from 'node:fs';
import { parseSchema } from '@posecast/wire';
import { Matrix4, Quaternion, Vector3 } from 'three';
import { expect, it, test } from 'vitest';
import { type Joint, type JointType, Kinematics, multiply, transform } from '../../src/model/kinematics.ts';
import { readManifest } from '../../src/model/manifest.ts';
import { LIGHT_COLORS } from '../../src/scene/canvas2d/colors.ts';
import { LightRobot } from '../../src/scene/canvas2d/robot.ts';
import { LightRobotNode } from '../../src/scene/canvas2d/robot_node.ts';
import { Player } from '../../src/twin/playback/player.ts';
import { NO_JOINTS } from '../../src/twin/playback/pose.ts';
import { jointsAt, positionOf } from '../rigs/joints.ts';

type Triple = [number, number, number];
type Four = [number, number, number, number];

function joint(type: JointType, changes: Partial<Joint> = {}): Joint {
  return {
    ...{ name: 'j', type, parent: 0, xyz: [0, 0, 0], quat: [1, 0, 0, 0], axis: [0, 0, 1] },
    ...{ plane: null, limits: null, mimic: null },
    ...changes,
  };
}

/** A reproducible sequence of numbers in −1…1. */
function numbers(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 31 - 1;
  };
}

function randomTree(count: number, seed: number): Joint[] {
  const next = numbers(seed);
  return Array.from({ length: count }, (_, i) => {
    const axis = new Vector3(next(), next(), next()).normalize();
    const turn = new Quaternion(next(), next(), next(), next()).normalize();
    const types: JointType[] = [
      'revolute',
      'continuous',
      'prismatic',
      'fixed',
      'revolute',
      'floating',
      'planar',
    ];
    const across = new Vector3(next(), next(), next()).cross(axis).normalize();
    const plane = [across.toArray(), axis.clone().cross(across).toArray()] as unknown as [Triple, Triple];
    return joint(types[i % types.length]!, {
      plane: types[i % types.length] === 'planar' ? plane : null,
      name: `j${i}`,
      parent: Math.floor(Math.abs(next()) * (i + 1)),
      xyz: [next(), next(), next()],
      quat: [turn.w, turn.x, turn.y, turn.z],
      axis: axis.toArray() as Triple,
    });
  });
}

const link = (model: Kinematics, i: number) => Array.from(model.rootFromLink.subarray(i * 16, i * 16 + 16));
const near = (a: ArrayLike<number>, b: ArrayLike<number>) => {
  expect(a.length).toBe(b.length);
  for (let i = 0; i < a.length; i += 1) expect(a[i]).toBeCloseTo(b[i]!, 9);
};

test('a random tree agrees with plain matrices', () => {
  const joints = randomTree(60, 7);
  const model = new Kinematics(joints);
  const next = numbers(11);
  for (let round = 0; round < 5; round += 1) {
    const readings = jointsAt(Object.fromEntries(model.jointNames.map((name) => [name, 4 * next()])));
    model.set(readings);
    model.compute();
    const world = [new Matrix4()];
    for (const { name, type, parent, xyz, quat, axis, plane } of joints) {
      const q = positionOf(readings, name) ?? 0;
      const of = (variable: string) => positionOf(readings, `${name}/${variable}`) ?? Number.NaN;
      const [w, x, y, z] = quat;
      const rest = new Matrix4().compose(
        new Vector3(...xyz),
        new Quaternion(x, y, z, w),
        new Vector3(1, 1, 1),
      );
      const move = new Matrix4();
      if (type === 'prismatic') move.makeTranslation(new Vector3(...axis).multiplyScalar(q));
      else if (type === 'revolute' || type === 'continuous') move.makeRotationAxis(new Vector3(...axis), q);
      else if (type === 'planar' && plane !== null) {
        const [x, y] = plane.map((way) => new Vector3(...way));
        const to = x!.multiplyScalar(of('x')).add(y!.multiplyScalar(of('y')));
        move.makeRotationAxis(new Vector3(...axis), of('theta')).setPosition(to);
      } else if (type === 'floating') {
        const turn = new Quaternion(of('rot_x'), of('rot_y'), of('rot_z'), of('rot_w')).normalize();
        const to = new Vector3(of('trans_x'), of('trans_y'), of('trans_z'));
        move.compose(to, turn, new Vector3(1, 1, 1));
      }
      world.push(world[parent]!.clone().multiply(rest).multiply(move));
    }
    for (const [i, expected] of world.entries()) near(link(model, i), expected.elements);
  }
});

test('turning there and back, and by whole turns, is standing still', () => {
  const chain = [
    joint('continuous', { axis: [0.6, 0, 0.8] }),
    joint('prismatic', { name: 'p', parent: 1, xyz: [1, 0, 0] }),
  ];
  const model = new Kinematics(chain);
  const rest = link(model, 2);
  for (const turns of [1, -3, 40]) {
    model.set(jointsAt({ j: turns * 2 * Math.PI }));
    model.compute();
    near(link(model, 2), rest);
  }
  model.set(jointsAt({ j: 1.2 }));
  model.compute();
  const there = link(model, 1);
  model.set(jointsAt({ j: -1.2 }));
  model.compute();
  const product = new Float64Array(16);
  multiply(product, 0, there, 0, link(model, 1), 0);
  near(product, new Matrix4().elements);
});

test('every pose keeps lengths and right angles, however far the readings are', () => {
  const model = new Kinematics(randomTree(40, 3));
  model.set(jointsAt(Object.fromEntries(model.jointNames.map((name, i) => [name, 1000 * Math.sin(i)]))));
  model.compute();
  for (let i = 0; i <= 40; i += 1) {
    const m = new Matrix4().fromArray(link(model, i));
    expect(m.determinant()).toBeCloseTo(1, 9);
    m.setPosition(0, 0, 0);
    near(m.clone().multiply(m.clone().transpose()).elements, new Matrix4().elements);
  }
});

test('limits do not clamp', () => {
  const model = new Kinematics([joint('prismatic', { limits: { lower: 0, upper: 0.1 } })]);
  model.set(jointsAt({ j: 0.5 }));
  model.compute();
  expect(model.rootFromLink[16 + 14]).toBe(0.5);
});

test('a follower follows with factor and offset, until it has a reading of its own', () => {
  const model = new Kinematics([
    joint('prismatic', { name: 'lead' }),
    joint('prismatic', { name: 'follow', mimic: { joint: 0, multiplier: -2, offset: 0.1 } }),
  ]);
  expect(model.value(1)).toBe(0.1);
  model.set(jointsAt({ lead: 0.3 }));
  expect(model.value(1)).toBeCloseTo(-0.5, 12);
  model.set(jointsAt({ follow: 7 }));
  expect(model.value(1)).toBe(7);
});

test('the same readings again, no reading, and joints nobody has change nothing', () => {
  const model = new Kinematics([
    joint('revolute'),
    joint('fixed', { name: 'f' }),
    joint('floating', { name: 'g' }),
  ]);
  expect(model.jointNames.filter((name) => !name.startsWith('g/'))).toEqual(['j']);
  expect(model.set(jointsAt({ j: 1 }))).toBe(true);
  expect(model.set(jointsAt({ j: 1 }))).toBe(false);
  expect(model.set(jointsAt({ j: Number.NaN }))).toBe(false);
  expect(model.set(jointsAt({ f: 1, g: 1, tail: 1 }))).toBe(false);
  expect(model.set(NO_JOINTS)).toBe(false);
  expect(model.value(0)).toBe(1);
});

test('a joint of several values takes each by itself: what never came stands at rest', () => {
  const plane: [Triple, Triple] = [
    [1, 0, 0],
    [0, 1, 0],
  ];
  const model = new Kinematics([
    joint('floating', { name: 'body' }),
    joint('planar', { name: 'cart', parent: 1, plane }),
  ]);
  expect(model.jointNames).toEqual([
    ...[
      'body/trans_x',
      'body/trans_y',
      'body/trans_z',
      'body/rot_x',
      'body/rot_y',
      'body/rot_z',
      'body/rot_w',
    ],
    ...['cart/x', 'cart/y', 'cart/theta'],
  ]);
  near(link(model, 2), new Matrix4().elements);
  model.set(jointsAt({ 'body/trans_z': 0.7 }));
  model.compute();
  near(link(model, 1), new Matrix4().setPosition(0, 0, 0.7).elements);
  // A quarter turn about z, with a quaternion of length 2; then x of the cart is y of the world.
  model.set(
    jointsAt({ 'body/rot_z': Math.SQRT2, 'body/rot_w': Math.SQRT2, 'cart/x': 2, 'cart/theta': -Math.PI / 2 }),
  );
  model.compute();
  near(link(model, 2), new Matrix4().setPosition(0, 2, 0.7).elements);
  model.set(jointsAt({ 'body/rot_z': 0, 'body/rot_w': 1e-9, 'cart/theta': 0 }));
  model.compute();
  near(link(model, 1), new Matrix4().setPosition(0, 0, 0.7).elements);
});

test('a transform is place, then turn, then scale', () => {
  const half = Math.SQRT1_2;
  const quat: Four = [half, 0, 0, half]; // a quarter turn about z
  const m = new Matrix4().fromArray(transform([1, 2, 3], quat, 2));
  near(new Vector3(1, 0, 0).applyMatrix4(m).toArray(), [1, 4, 3]);
});

type Seven = [number, number, number, number, number, number, number];

interface Case {
  readonly name: string;
  readonly manifest: Record<string, unknown>;
  readonly schema: string;
  /** The codes of each frame; `links`: world_from_link in the manifest's order, metres and a quaternion w, x, y, z. */
  readonly frames: readonly { readonly codes: readonly number[]; readonly links: readonly Seven[] }[];
}

const VECTORS = new URL('../../../wire/vectors/link_poses.json', import.meta.url);
const { cases } = JSON.parse(readFileSync(VECTORS, 'utf8')) as { cases: readonly Case[] };

const ignore = () => {};

/** A robot on the page, whichever renderer draws it. */
class Posed extends LightRobotNode {
  constructor(manifest: Record<string, unknown>) {
    super({ tones: () => LIGHT_COLORS.dark, placed: ignore, framed: ignore, changed: ignore });
    this.adopt(new LightRobot(readManifest(manifest), LIGHT_COLORS.dark));
  }
}

it.each(cases)(
  '$name: the page has its links where an export of the past has them',
  ({ manifest, schema: text, frames }) => {
    const schema = parseSchema(text);
    const player = new Player(schema);
    player.raw = true;
    const node = new Posed(manifest);
    const links = manifest.links as string[];
    frames.forEach(({ codes, links: wanted }, seq) => {
      const atMs = seq * 100;
      const times = { tS: seq / 10, freshMs: atMs, bornMs: atMs, changedMs: atMs, atMs };
      player.push({ schemaId: schema.id, seq, codes: Int32Array.from(codes), ...times });
      player.sample(atMs);
      node.setPose(player.pose('pos'), true);
      const poses = node.linkPoses();
      expect(Object.keys(poses)).toEqual(links);
      links.forEach((link, i) => {
        const [x, y, z, ...quat] = wanted[i]!;
        const m = transform([x, y, z], quat);
        poses[link]!.forEach((found, at) => {
          expect(found, `${link} in frame ${seq}`).toBeCloseTo(m[(at % 4) * 4 + Math.floor(at / 4)]!, 5);
        });
      });
    });
  },
);
