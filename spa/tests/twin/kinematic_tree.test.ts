import { expect, it } from 'vitest';
import { JointChannels, KinematicTree } from '../../src/twin/kinematic_tree.ts';
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
