import type { Schema } from '@posecast/wire';
import { expect, it } from 'vitest';
import { moreEn } from '../../src/app/text/more_en.ts';
import { KinematicTree, type TreeLink } from '../../src/twin/kinematic_tree.ts';
import { limbsOf } from '../../src/twin/limbs.ts';
import { schemaWith } from '../rigs/schema.ts';

function schemaOf(joint: readonly string[], names: Readonly<Record<string, string>> = {}): Schema {
  const fields = [{ name: 'pos', unit: 'rad', scale: 0.001, labels: 'joint' }];
  return schemaWith({ joint }, fields, { mapping: { names } });
}

/** `A>B` attaches B to A; each joint moves the link with its name. */
function treeOf(...chains: readonly string[]): KinematicTree {
  const links = new Map<string, TreeLink>([['root', { link: 'root', parent: null, joint: null }]]);
  for (const chain of chains) {
    const names = chain.split('>');
    names.forEach((name, i) => {
      if (!links.has(name)) links.set(name, { link: name, parent: names[i - 1] ?? 'root', joint: name });
    });
  }
  return new KinematicTree([...links.values()]);
}

const titles = (schema: Schema, tree: KinematicTree | null = null) =>
  limbsOf(schema, tree, moreEn).map(({ title, labels }) => `${title}: ${labels.join(' ')}`);

const HUBO = [
  'WST',
  'LSP',
  'LSR',
  'LEB',
  'LF1',
  'LF2',
  'RSP',
  'RSR',
  'REB',
  'LHP',
  'LKN',
  'LAP',
  'RHP',
  'RKN',
  'RAP',
];
const HUBO_TREE = treeOf('WST>LSP>LSR>LEB>LF1', 'LEB>LF2', 'WST>RSP>RSR>REB', 'LHP>LKN>LAP', 'RHP>RKN>RAP');

it('cuts the kinematic tree where long branches part; fingers stay with their arm', () => {
  expect(titles(schemaOf(HUBO), HUBO_TREE)).toEqual([
    'WST: WST',
    'Left: LSP LSR LEB LF1 LF2',
    'Right: RSP RSR REB',
    'Left: LHP LKN LAP',
    'Right: RHP RKN RAP',
  ]);
});

it('calls a limb what its joints are called', () => {
  const names = {
    WST: 'waist yaw',
    LSP: 'left shoulder pitch',
    LSR: 'left shoulder roll',
    LEB: 'left elbow',
    LHP: 'left hip pitch',
    LKN: 'left knee',
  };
  expect(titles(schemaOf(HUBO, names), HUBO_TREE).map((title) => title.split(':')[0])).toEqual([
    'Trunk',
    'Left arm',
    'Right',
    'Left leg',
    'Right',
  ]);
});

it('goes by names alone without a model', () => {
  const schema = schemaOf([
    'left_hip_pitch_joint',
    'left_knee_joint',
    'right_hip_pitch_joint',
    'waist_yaw_joint',
    'leftWristRoll',
    'spinner',
  ]);
  expect(titles(schema)).toEqual([
    'Left leg: left_hip_pitch_joint left_knee_joint',
    'Right leg: right_hip_pitch_joint',
    'Trunk: waist_yaw_joint',
    'Left arm: leftWristRoll',
    'Other joints: spinner',
  ]);
  expect(titles(schemaOf(['LKN', 'RKN', 'NK1', 'LAMP']))).toEqual([
    'Left: LKN',
    'Right: RKN',
    'Other joints: NK1 LAMP',
  ]);
});

it('keeps a joint that the model does not have', () => {
  expect(titles(schemaOf(['LKN', 'RKN', 'TAIL']), treeOf('LKN', 'RKN'))).toEqual([
    'Left: LKN',
    'Right: RKN',
    'Other joints: TAIL',
  ]);
});

it('leaves an arm alone in one piece, its two fingers included', () => {
  expect(titles(schemaOf(['a1', 'a2', 'a3', 'g1', 'g2']), treeOf('a1>a2>a3>g1', 'a3>g2'))).toEqual([
    'a1 to g2: a1 a2 a3 g1 g2',
  ]);
});

it('takes any name for a name', () => {
  const odd = ['__proto__', 'constructor', '<b>', 'x'.repeat(200)];
  expect(limbsOf(schemaOf(odd), null, moreEn).flatMap(({ labels }) => labels)).toEqual(odd);
});
