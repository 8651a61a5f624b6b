import { expect, it } from 'vitest';
import { wordsOfName } from '../src/twin/plain_names.ts';
import { SCHEMA } from './schema.ts';

it('is what the profile says, else the words that the name is made of', () => {
  const names = [
    'RKN',
    'LKN',
    'left_hip_pitch_joint',
    'leftHipPitch',
    'Left_Knee',
    'panda_joint1',
    'LF_HAA',
    'j1',
  ];
  expect(names.map((label) => wordsOfName(SCHEMA, label))).toEqual([
    'right knee',
    null,
    'left hip pitch',
    'left hip pitch',
    'left knee',
    'panda joint1',
    null,
    null,
  ]);
});
