// @vitest-environment happy-dom
import { expect, test } from 'vitest';
import { modelOf, type UrdfModel } from '../../src/urdf/manifest.ts';
import { LodBuilder } from '../../src/urdf/meshes/lod_builder.ts';
import { ownMesh } from '../../src/urdf/meshes/primitives.ts';
import { readUrdf } from '../../src/urdf/reader.ts';
import { readXml } from '../../src/urdf/xml.ts';

/** A robot with almost no visuals is drawn as its skeleton (edge-agent/tests/test_bones.py has the same). */

const link = (name: string, inside = '') => `<link name="${name}">${inside}</link>`;
const turning = (name: string, parent: string, child: string, xyz: string, type = 'revolute') =>
  `<joint name="${name}" type="${type}"><parent link="${parent}"/><child link="${child}"/><origin xyz="${xyz}"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>`;
const JOINTS = turning('ab', 'a', 'b', '0 0 0.5') + turning('bc', 'b', 'c', '0.3 0 0', 'prismatic');
const BALL = '<geometry><sphere radius="0.1"/></geometry>';
const ALL = [...'abc'];

function modelIn(inside: string, canBeDrawn?: (uri: string) => boolean): UrdfModel {
  return modelOf(readUrdf(readXml(`<robot name="r">${inside}</robot>`)), canBeDrawn);
}
const sources = ({ manifest }: UrdfModel) => manifest.visuals.map(({ source }) => source);

/** The box of each visual in its link, metres. */
function boxes({ shapes }: UrdfModel) {
  const lod = new LodBuilder(shapes);
  return shapes.map((shape, i) => lod.put(i, ownMesh(shape)));
}

test('links become bones, and joints their axes', () => {
  const model = modelIn(ALL.map((name) => link(name)).join('') + JOINTS);
  expect(sources(model)).toEqual(['bones', 'bones', 'bones']);
  const [base, arm, tip] = boxes(model);
  const radius = 0.0192; // 0.024 of 0.8 m
  const near = (numbers: readonly number[]) => numbers.map((value) => expect.closeTo(value, 3));
  expect(base).toEqual({ min: near([-0.0128, -0.0128, 0]), max: near([0.0128, 0.0128, 0.5]) });
  expect(arm).toEqual({
    min: near([-radius, -0.75 * radius, -radius]),
    max: near([0.3, 0.75 * radius, radius]),
  });
  expect([tip!.min[1], tip!.max[1]]).toEqual(near([-2.5 * radius, 2.5 * radius]));
  expect(tip!.max[0], 'on in the direction of the bone before').toBeCloseTo(0.12, 3);
  const paints = model.shapes.map((shape) => new Set(ownMesh(shape).map(({ paint }) => paint)).size);
  expect(paints, 'axes have a colour of their own').toEqual([1, 2, 2]);
});

test('few links without shells get none', () => {
  const dressed = ALL.map((name) => link(name, `<visual>${BALL}</visual>`)).join('');
  const bare =
    link('d') + link('e') + turning('cd', 'c', 'd', '0 0 0.1') + turning('de', 'd', 'e', '0 0 0', 'fixed');
  expect(sources(modelIn(dressed + bare + JOINTS))).toEqual(['sphere', 'sphere', 'sphere']);
});

test('one collision shape does not hide the skeleton; one for each link is a body', () => {
  const hull = '<collision><geometry><cylinder radius="1" length="1"/></geometry></collision>';
  expect(
    sources(
      modelIn(
        link('a', hull) +
          [...'bcd'].map((name) => link(name)).join('') +
          JOINTS +
          turning('cd', 'c', 'd', '0.2 0 0'),
      ),
    ),
  ).toEqual(['bones', 'bones', 'bones', 'bones']);
  const each = ALL.map((name) => link(name, `<collision>${BALL}</collision>`)).join('');
  expect(sources(modelIn(each + JOINTS))).toEqual(['sphere', 'sphere', 'sphere']);
});

test('meshes that are all missing leave the skeleton beside their names', () => {
  const meshes = ALL.map((name) =>
    link(name, `<visual><geometry><mesh filename="${name}.stl"/></geometry></visual>`),
  ).join('');
  expect(sources(modelIn(meshes + JOINTS))).toEqual(['a.stl', 'b.stl', 'c.stl']);
  const torn = modelIn(meshes + JOINTS, () => false);
  expect(sources(torn)).toEqual(['a.stl', 'b.stl', 'c.stl', 'bones', 'bones', 'bones']);
  expect(torn.manifest.visuals.map(({ link: of }) => of)).toEqual([0, 1, 2, 0, 1, 2]);
});

test('all in one place there are no bones; a thousand links have as many', () => {
  const nowhere = turning('ab', 'a', 'b', '0 0 0') + turning('bc', 'b', 'c', '0 0 0');
  expect(sources(modelIn(ALL.map((name) => link(name)).join('') + nowhere))).toEqual([]);
  const chain = Array.from({ length: 1000 }, (_, i) =>
    i === 0 ? link('l0') : link(`l${i}`) + turning(`j${i}`, `l${i - 1}`, `l${i}`, '0.1 0 0'),
  );
  expect(sources(modelIn(chain.join('')))).toHaveLength(1000);
});
