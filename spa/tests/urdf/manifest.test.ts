// @vitest-environment happy-dom
import { parseSchema } from '@posecast/wire';
import { describe, expect, test } from 'vitest';
import { BalanceReader } from '../../src/model/balance/balance_reader.ts';
import { readMasses, readSoles } from '../../src/model/balance/masses_and_soles.ts';
import { chooseStanding } from '../../src/model/balance/standing_choice.ts';
import { toldOfMasses } from '../../src/twin/balance/lacks.ts';
import { modelOf, UrdfError } from '../../src/urdf/manifest.ts';
import { readUrdf } from '../../src/urdf/reader.ts';
import { readXml } from '../../src/urdf/xml.ts';

const robot = (inside: string) => `<?xml version="1.0"?>\n<robot name="r">${inside}</robot>`;
const joint = (name: string, parent: string, child: string, more = '', type = 'revolute') =>
  `<joint name="${name}" type="${type}"><parent link="${parent}"/><child link="${child}"/>${more}</joint>`;
const links = (...names: string[]) => names.map((name) => `<link name="${name}"/>`).join('');
const SCHEMA = JSON.stringify({
  ...{ type: 'schema', v: 1, robot: 'r', labels: { joint: ['j'] } },
  fields: [{ name: 'pos', labels: 'joint' }],
});
const modelIn = (text: string) => modelOf(readUrdf(readXml(text)));

test.each([
  ['no links', robot(''), /^URDF: no links$/],
  ['a circle', robot(links('a', 'b') + joint('1', 'a', 'b') + joint('2', 'b', 'a')), /^URDF: no root/],
])('%s can not be drawn', (_, text, why) => {
  expect(() => modelIn(text)).toThrow(UrdfError);
  expect(() => modelIn(text)).toThrow(why);
});

test('tuples with spaces and line breaks are numbers; what is none is named and replaced', () => {
  const { manifest, problems } = modelIn(
    robot(
      links('a', 'b', 'c') +
        joint('j', 'a', 'b', '<origin xyz=" 1  2\n 3 " rpy="0 0 0"/><axis xyz=" 0 0  1"/>') +
        joint('k', 'b', 'c', '<origin xyz="1 2" rpy="0 nan 0"/><axis/>'),
    ),
  );
  expect(manifest.joints.map(({ xyz }) => xyz)).toEqual([
    [1, 2, 3],
    [0, 0, 0],
  ]);
  expect(manifest.joints.map(({ axis }) => axis)).toEqual([
    [0, 0, 1],
    [1, 0, 0],
  ]);
  expect(problems).toEqual([
    "joint 'k': <origin xyz> needs three numbers",
    "joint 'k': <origin rpy> is not finite: '0 nan 0'",
  ]);
});

test('what hangs on nothing is left out and named, the rest stays', () => {
  const { manifest, problems } = modelIn(
    robot(
      links('a', 'b', 'x', 'y') +
        joint('j', 'a', 'b') +
        joint('k', 'gone', 'x') +
        joint('l', 'x', 'y') +
        joint('m', 'a', 'y'),
    ),
  );
  expect(problems).toEqual([
    "joint 'k': its parent link 'gone' does not exist; this joint is left out",
    "link 'y' has two parent joints, 'l' and 'm'; this joint is left out",
    "link 'x' with the 1 below it is not connected to the root 'a'; not shown",
  ]);
  expect(manifest.links).toEqual(['a', 'b']);
  expect(manifest.joints.map(({ name }) => name)).toEqual(['j']);
});

test('an axis of zero, a mimic of nobody and a visual without a shape harm nobody', () => {
  const { manifest, problems } = modelIn(
    robot(
      `<link name="a"><visual><geometry/></visual><visual/></link>${links('b', 'c')}` +
        joint('j', 'a', 'b', '<axis xyz="0 0 0"/>') +
        joint('k', 'b', 'c', '<axis xyz="0 0 1"/><mimic joint="nobody"/>'),
    ),
  );
  expect(manifest.visuals).toEqual([]);
  expect(manifest.joints.map(({ mimic }) => mimic)).toEqual([null, null]);
  expect(manifest.joints[0]!.axis, 'what the doctor says of it').toEqual([1, 0, 0]);
  expect(problems).toEqual(["joint 'k' mimics joint 'nobody', which does not exist"]);
});

test('a material defined inside one visual serves those that only name it', () => {
  const shape = '<geometry><box size="1 1 1"/></geometry>';
  const { shapes } = modelIn(
    robot(
      `<link name="a"><visual>${shape}<material name="dark"><color rgba="0.2 0.2  0.2 1"/></material></visual></link>` +
        `<link name="b"><visual>${shape}<material name="dark"/></visual></link>${joint('j', 'a', 'b')}`,
    ),
  );
  const dark = [...Array(3).fill(expect.closeTo(0.0331, 4)), 1];
  expect(shapes.map(({ paint }) => paint)).toEqual([dark, dark]);
});

test.each([0, 0.004, 0.4, 1])('what has opacity %s has it, also where it is invisible', (opacity) => {
  const shape = '<geometry><box size="1 1 1"/></geometry>';
  const paint = `<material name="m"><color rgba="1 0 1 ${opacity}"/></material>`;
  const { shapes } = modelIn(robot(`<link name="a"><visual>${shape}${paint}</visual></link>`));
  expect(shapes.map(({ paint }) => paint)).toEqual([[1, 0, 1, opacity]]);
});

describe('a joint that mimics another', () => {
  const chain = (...mimics: string[]) =>
    robot(
      links('l0', ...mimics.map((_, i) => `l${i + 1}`)) +
        mimics.map((mimic, i) => joint(`j${i}`, `l${i}`, `l${i + 1}`, mimic)).join(''),
    );
  const mimicsIn = (text: string) => modelIn(text).manifest.joints.map(({ mimic }) => mimic);

  test('follows the one at the end of a chain, by what the chain makes of its value', () => {
    const text = chain(
      '',
      '<mimic joint="j0" multiplier="2" offset="0.5"/>',
      '<mimic joint="j1" multiplier="-3" offset="1"/>',
    );
    expect(mimicsIn(text)).toEqual([
      null,
      { joint: 0, multiplier: 2, offset: 0.5 },
      { joint: 0, multiplier: -6, offset: -0.5 },
    ]);
  });

  test('follows none where they go round in a circle, or by numbers that have no end', () => {
    const circle = chain('<mimic joint="j1"/>', '<mimic joint="j0"/>');
    expect(mimicsIn(circle)).toEqual([null, null]);
    const endless = chain(
      '',
      '<mimic joint="j0" multiplier="1e200"/>',
      '<mimic joint="j1" multiplier="1e200"/>',
    );
    expect(mimicsIn(endless).at(-1)).toBeNull();
    expect(modelIn(endless).problems).toEqual([
      "joint 'j2' mimics another with a multiplier or offset that is not finite",
    ]);
  });
});

describe('masses', () => {
  const weighing = (mass: number) =>
    `<inertial><origin xyz="0.1 0.2 0.3" rpy="0 0 1.5707963267948966"/><mass value="${mass}"/>
    <inertia ixx="1" ixy="0.1" ixz="0" iyy="2" iyz="0" izz="2.5"/></inertial>`;
  const weighed = (first: string, second = '') =>
    modelIn(robot(`<link name="a">${first}</link><link name="b">${second}</link>${joint('j', 'a', 'b')}`))
      .manifest;

  test('stand in the axes of their links, as the edge writes them', () => {
    const [found, ...more] = readMasses(weighed('', weighing(2))) ?? [];
    expect(more).toEqual([]);
    expect(found).toMatchObject({ link: 1, massKg: 2, xyz: [0.1, 0.2, 0.3] });
    for (const [i, moment] of [2, -0.1, 0, 1, 0, 2.5].entries())
      expect(found!.inertia[i]).toBeCloseTo(moment, 9);
  });

  test('none, where one can not be; soles are not known', () => {
    expect(readMasses(weighed('', ''))).toEqual([]);
    expect(readMasses(weighed(weighing(2), weighing(-2)))).toEqual([]);
    const far = weighed(weighing(2), weighing(2).replace('0.1 0.2 0.3', '0 0 -200'));
    expect(readMasses(far)).toEqual([]);
    expect(toldOfMasses(far.raw.findings)).toEqual([
      "link 'b': a centre of mass 200 m away (millimetres?); no balance is shown",
    ]);
    expect(readSoles(weighed(weighing(2)))).toBeNull();
  });

  test.each([
    ['mass', 'value="2"', 'value="nan"'],
    ['centre', '0.2 0.3', 'inf 0.3'],
    ['inertia', 'ixy="0.1"', 'ixy="a"'],
    ['axes', 'rpy="0 0 1.5707963267948966"', 'rpy="0 0"'],
  ])('none, where one is no number: %s', (_, good, bad) => {
    const manifest = weighed(weighing(2), weighing(2).replace(good, bad));
    expect(readMasses(manifest)).toEqual([]);
    const [told, ...others] = toldOfMasses(manifest.raw.findings);
    expect(told).toMatch(/^link 'b': .*; no balance is shown$/);
    expect(others).toEqual([]);
    expect(chooseStanding(manifest, parseSchema(SCHEMA)).massGap).toBe('impossible-masses');
  });
});

test('its centre of mass is known without soles, and what needs these has a reason of its own', () => {
  const moments = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>';
  const inertial = `<inertial><mass value="3"/>${moments}</inertial>`;
  const { manifest } = modelIn(`<robot name="r"><link name="trunk">${inertial}</link></robot>`);
  const reader = new BalanceReader(manifest, parseSchema(SCHEMA));
  const { massKg, centreOfMass, gaps } = reader.ofFrame(new Int32Array(1), 0);
  expect([massKg, centreOfMass]).toEqual([3, [0, 0, expect.any(Number)]]);
  expect(gaps).toMatchObject({ centreOfMass: null, polygon: 'raw', margin: 'raw' });
  expect([reader.hasAny, reader.problems]).toEqual([true, []]);
});
