import { expect, it } from 'vitest';
import { KinematicTree } from '../../src/twin/kinematic_tree.ts';

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
