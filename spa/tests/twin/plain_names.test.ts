import { parseSchema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { wordsOfName } from '../../src/twin/names.ts';
import { SCHEMA, SCHEMA_TEXT } from '../rigs/schema.ts';

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
  expect(names.map((label) => wordsOfName(SCHEMA, label, 'en'))).toEqual([
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

it('is in the language of who reads it, if the profile has that', () => {
  const doc = JSON.parse(SCHEMA_TEXT);
  const mapping = { ...doc.mapping, translated_names: { ko: { RKN: '오른쪽 무릎' } } };
  const schema = parseSchema(JSON.stringify({ ...doc, mapping }));
  expect(wordsOfName(schema, 'RKN', 'ko')).toBe('오른쪽 무릎');
  expect(wordsOfName(schema, 'RKN', 'en')).toBe('right knee');
  expect(wordsOfName(schema, 'left_hip_joint', 'ko')).toBe('left hip');
});
