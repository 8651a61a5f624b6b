import { parseSchema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { JointChannels } from '../../src/twin/joint_channels.ts';

const schema = parseSchema(
  JSON.stringify({
    type: 'schema',
    v: 1,
    robot: 'Nods',
    labels: { joint: ['NK1', 'NK2', 'RKN', '__proto__'] },
    fields: [{ name: 'pos', unit: 'rad', scale: 0.001, labels: 'joint' }],
    mapping: {
      joints: {
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
      },
    },
  }),
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
