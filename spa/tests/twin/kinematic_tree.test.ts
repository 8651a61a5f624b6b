import { parseSchema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { JointChannels, KinematicTree, listUnmoving } from '../../src/twin/kinematic_tree.ts';
import { schemaWith } from '../rigs/schema.ts';

const TREE = new KinematicTree([
  { link: 'base', parent: null, joint: null },
  { link: 'thigh', parent: 'base', joint: 'hip' },
  { link: 'shin', parent: 'thigh', joint: 'knee' },
  { link: 'sole', parent: 'shin', joint: null },
  { link: 'lamp', parent: 'base', joint: null },
]);

it('tells which joint moves a link, also one that is only fixed to another', () => {
  expect(['base', 'thigh', 'shin', 'sole', 'lamp', 'nobody'].map((link) => TREE.jointOf(link))).toEqual([
    null,
    'hip',
    'knee',
    'knee',
    null,
    null,
  ]);
});

it('tells what a joint moves as one body, where it sits, and what comes before it', () => {
  expect(TREE.joints).toEqual(['hip', 'knee']);
  expect(TREE.bodyOf('knee')).toEqual(['shin', 'sole']);
  expect(TREE.linkOf('knee')).toBe('shin');
  expect(TREE.linkOf('elbow')).toBeNull();
  expect([TREE.before('knee'), TREE.before('hip'), TREE.before('elbow')]).toEqual(['hip', null, null]);
});

const joints = {
  nod: {
    terms: [
      ['NK1', 0.5],
      ['NK2', 0.5],
    ],
  },
  tilt: {
    terms: [
      ['NK1', -0.2],
      ['NK2', 0.6],
    ],
  },
  finger: { terms: [['NK2', 0]] },
};
const schema = schemaWith(
  { joint: ['NK1', 'NK2', 'RKN', '__proto__'] },
  [{ name: 'pos', unit: 'rad', scale: 0.001, labels: 'joint' }],
  { mapping: { joints } },
);

it('finds the joints of a channel and the channel of a joint, couplings included', () => {
  const channels = new JointChannels(schema);
  expect(channels.jointsOf('NK1')).toEqual(['NK1', 'nod', 'tilt']);
  expect(channels.jointsOf('RKN')).toEqual(['RKN']);
  expect(channels.jointsOf('nobody')).toEqual([]);
  expect(['nod', 'tilt', 'RKN', 'finger', 'elbow'].map((joint) => channels.channelOf(joint))).toEqual([
    'NK1',
    'NK2',
    'RKN',
    null,
    null,
  ]);
  expect(channels.channelOf('__proto__')).toBe('__proto__');
});

const robot = (field: string, labels: readonly string[], mapping: object = {}) =>
  parseSchema(
    JSON.stringify({
      ...{ type: 'schema', v: 1, robot: 'r', labels: { joint: labels }, mapping },
      fields: [{ name: field, labels: 'joint', unit: 'rad', scale: 0.001 }],
    }),
  );

it.each([
  ['of the joints', 'pos', ['hip', 'knee'], {}, true],
  ['of one joint', 'pos', ['arm', 'knee'], {}, true],
  ['commands', 'ref', ['knee'], {}, true],
  ['with a prefix', 'pos', ['r1/hip', 'r1/knee'], {}, false],
  ['with a suffix', 'pos', ['hip_joint', 'knee_joint'], {}, false],
  ['in other letters', 'pos', ['Hip', 'KNEE'], {}, false],
  ['of others', 'pos', ['elbow'], {}, false],
  ['mapped by a profile', 'pos', ['M1'], { joints: { hip: { terms: [['M1', 1]], offset: 0 } } }, true],
  ['mapped to others', 'pos', ['M1'], { joints: { elbow: { terms: [['M1', 1]], offset: 0 } } }, false],
  ['of a floating joint', 'pos', ['knee/trans_x', 'knee/rot_w'], {}, true],
  ['of another floating joint', 'pos', ['cube/trans_x'], {}, false],
  ['of no position', 'temp', ['motor'], {}, true],
] as const)('finds out whether readings %s move the model', (_, field, labels, mapping, moves) => {
  const unmoving = listUnmoving(robot(field, labels, mapping), ['hip', 'knee']);
  expect(unmoving === null).toBe(moves);
  if (unmoving !== null) expect(labels.every((label) => unmoving.includes(label))).toBe(true);
  expect(listUnmoving(robot(field, labels, mapping), []), 'a model that does not move').toBeNull();
});
