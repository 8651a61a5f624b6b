import { expect, it } from 'vitest';
import { type BodyJoint, jointOfLinks } from '../../src/model/posed_body.ts';

it('what hangs rigidly on a link moves with the joint before it; the root with none', () => {
  const joint = (link: string) => ({ link }) as BodyJoint;
  const figure = {
    linkNames: ['base', 'thigh', 'shin', 'sole', 'lamp'],
    jointNames: ['hip', 'knee'],
    joint: (name: string) => ({ hip: joint('thigh'), knee: joint('shin') })[name],
    bones: () =>
      [
        ['base', 'thigh'],
        ['thigh', 'shin'],
        ['shin', 'sole'],
        ['base', 'lamp'],
      ] as const,
  };
  expect(Object.fromEntries(jointOfLinks(figure))).toEqual({
    base: null,
    thigh: 'hip',
    shin: 'knee',
    sole: 'knee',
    lamp: null,
  });
});
