// @vitest-environment happy-dom
import { expect, test } from 'vitest';
import { readUrdf, UrdfError } from './document.ts';

const robot = (inside: string) => `<?xml version="1.0"?>\n<robot name="r">${inside}</robot>`;
const joint = (name: string, parent: string, child: string, more = '', type = 'revolute') =>
  `<joint name="${name}" type="${type}"><parent link="${parent}"/><child link="${child}"/>${more}</joint>`;
const links = (...names: string[]) => names.map((name) => `<link name="${name}"/>`).join('');

test.each([
  ['not XML', '<robot>\n<link name="a></robot>', /^URDF: error on line 2/],
  ['empty', '', /^URDF: error on line 1/],
  ['a web page', '<html><body/></html>', /^URDF: no <robot> element$/],
  ['no links', robot(''), /^URDF: no links$/],
  ['a circle', robot(links('a', 'b') + joint('1', 'a', 'b') + joint('2', 'b', 'a')), /^URDF: no root/],
])('%s can not be drawn', (_, text, why) => {
  expect(() => readUrdf(text)).toThrow(UrdfError);
  expect(() => readUrdf(text)).toThrow(why);
});

test('tuples with spaces and line breaks are numbers; what is none is named and replaced', () => {
  const { robot: read, problems } = readUrdf(
    robot(
      links('a', 'b', 'c') +
        joint('j', 'a', 'b', '<origin xyz=" 1  2\n 3 " rpy="0 0 0"/><axis xyz=" 0 0  1"/>') +
        joint('k', 'b', 'c', '<origin xyz="1 2" rpy="0 nan 0"/><axis/>'),
    ),
  );
  const values = (tag: string, name: string) =>
    [...read.querySelectorAll(tag)].map((element) => element.getAttribute(name));
  expect(values('origin', 'xyz')).toEqual(['1 2 3', '0 0 0']);
  expect(values('axis', 'xyz')).toEqual(['0 0 1', '1 0 0']);
  expect(problems).toEqual([
    'joint k: <origin xyz="1 2"> is not 3 numbers',
    'joint k: <origin rpy="0 nan 0"> is not 3 numbers',
  ]);
});

test('what hangs on nothing is left out and named, the rest stays', () => {
  const { robot: read, problems } = readUrdf(
    robot(
      links('a', 'b', 'x', 'y') +
        joint('j', 'a', 'b') +
        joint('k', 'gone', 'x') +
        joint('l', 'x', 'y') +
        joint('m', 'a', 'y'),
    ),
  );
  expect(problems).toEqual([
    'joint k: link "gone" does not exist; the joint is left out',
    'joint m: link "y" has a joint already; the joint is left out',
    'not connected to "a" and not drawn: x, y',
  ]);
  expect([...read.querySelectorAll('link')].map((link) => link.getAttribute('name'))).toEqual(['a', 'b']);
  expect([...read.querySelectorAll('joint')].map((left) => left.getAttribute('name'))).toEqual(['j']);
});

test('an axis of zero, a mimic of nobody and a visual without a shape harm nobody', () => {
  const { robot: read, problems } = readUrdf(
    robot(
      `<link name="a"><visual><geometry/></visual><visual/></link>${links('b', 'c')}` +
        joint('j', 'a', 'b', '<axis xyz="0 0 0"/>') +
        joint('k', 'b', 'c', '<axis xyz="0 0 1"/><mimic joint="nobody"/>'),
    ),
  );
  expect(read.querySelectorAll('visual').length).toBe(0);
  expect(read.querySelectorAll('mimic').length).toBe(0);
  expect(read.querySelector('joint')?.getAttribute('type')).toBe('fixed');
  expect(problems).toEqual([
    'joint j: its axis is zero; it is drawn as fixed',
    'joint k: mimics "nobody", which does not exist',
  ]);
});

test('a material defined inside one visual serves those that only name it', () => {
  const shape = '<geometry><box size="1 1 1"/></geometry>';
  const { robot: read } = readUrdf(
    robot(
      `<link name="a"><visual>${shape}<material name="dark"><color rgba="0.2 0.2  0.2 1"/></material></visual></link>` +
        `<link name="b"><visual>${shape}<material name="dark"/></visual></link>${joint('j', 'a', 'b')}`,
    ),
  );
  const top = [...read.children].filter((child) => child.nodeName === 'material');
  expect(top.map((material) => material.querySelector('color')?.getAttribute('rgba'))).toEqual([
    '0.2 0.2 0.2 1',
  ]);
});
