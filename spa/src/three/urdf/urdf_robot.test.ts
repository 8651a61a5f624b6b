// @vitest-environment happy-dom
import { existsSync, readFileSync } from 'node:fs';
import { resolve } from 'node:path';
import { Box3, Color, Mesh, type MeshStandardMaterial, Object3D, Ray, Vector3 } from 'three';
import { expect, test } from 'vitest';
import { cubeSoup } from '../../urdf/mesh_samples.ts';
import { weld } from '../../urdf/weld.ts';
import { StaleEffect } from '../robot/stale_effect.ts';
import type { MeshPart } from './mesh_loader.ts';
import { Palette } from './palette.ts';
import { UrdfRobot } from './urdf_robot.ts';

const SHARED = process.env.POSECAST_SHARED ?? resolve(import.meta.dirname, '../../../../../shared');

const ARM = `<robot name="arm">
  <link name="base"><visual><geometry><box size="0.4 0.4 0.2"/></geometry></visual></link>
  <link name="upper"><visual><origin xyz="0 0 0.5" rpy="0 0 0"/>
    <geometry><mesh filename="package:///arm/Upper.STL" scale="0.1 0.1 1"/></geometry>
    <material name="grey"><color rgba="0.5 0.5  0.5 1"/></material></visual></link>
  <link name="lower"/><link name="slide"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 2 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 1 0"/><mimic joint="shoulder" multiplier="-2" offset="0.1"/></joint>
  <joint name="rod" type="prismatic"><parent link="lower"/><child link="slide"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
</robot>`;

function arm(): UrdfRobot {
  const model = new UrdfRobot(ARM, new Palette(new StaleEffect(new Color()), { value: new Color() }));
  model.place([0, 0, 0], [1, 0, 0, 0]);
  return model;
}

const angles = (values: Record<string, number>) => new Map(Object.entries(values));

function at(model: UrdfRobot, link: string): number[] {
  const m = model.linkMatrix(link)!.elements;
  return [m[12]!, m[13]!, m[14]!].map((value) => Math.round(value * 1e6) / 1e6 + 0);
}

const cube: MeshPart = { surface: weld(cubeSoup()), color: null, opacity: 1 };

test('limits do not clamp what a robot reports, a follower follows with its offset', () => {
  const model = arm();
  expect(model.jointNames).toEqual(['shoulder', 'rod', 'elbow']);
  expect(model.setJoints(angles({ shoulder: Math.PI / 2, rod: 0.5 }))).toBe(true);
  model.place([0, 0, 0], [1, 0, 0, 0]);
  const bend = Math.PI / 2 - Math.PI + 0.1;
  expect(at(model, 'lower')).toEqual([1, 0, 0]);
  expect(at(model, 'slide')[0]).toBeCloseTo(1 + 0.5 * Math.sin(bend), 5);
  expect(at(model, 'slide')[2]).toBeCloseTo(0.5 * Math.cos(bend), 5);
});

test('where the robot reports the follower itself, that reading wins', () => {
  const model = arm();
  model.setJoints(angles({ elbow: 0, shoulder: Math.PI / 2, rod: 1 }));
  model.place([0, 0, 0], [1, 0, 0, 0]);
  expect(at(model, 'slide')).toEqual([2, 0, 0]);
});

test('the same angles again, no reading, and joints nobody has change nothing', () => {
  const model = arm();
  expect(model.setJoints(angles({ shoulder: 0.3 }))).toBe(true);
  expect(model.setJoints(angles({ shoulder: 0.3 }))).toBe(false);
  expect(model.setJoints(angles({ shoulder: Number.NaN, tail: 1 }))).toBe(false);
  expect(model.setJoints(angles({}))).toBe(false);
  model.setJoints(angles({ rod: 1 }));
  model.place([0, 0, 0], [1, 0, 0, 0]);
  expect(at(model, 'lower')[0]).toBeCloseTo(Math.sin(0.3), 5);
});

test('without a base it stands on its lowest point; with one it is where the base says', () => {
  const model = arm();
  model.ground();
  expect(at(model, 'base')).toEqual([0, 0, 0.1]);
  model.setJoints(angles({ shoulder: Math.PI }));
  model.slots[0]!.fill([cube]);
  model.ground();
  expect(at(model, 'base')).toEqual([0, 0, 1]);
  model.place([1, 2, 3], [2, 0, 0, 2]);
  expect(at(model, 'base')).toEqual([1, 2, 3]);
  expect(model.linkMatrix('base')!.elements[0]).toBeCloseTo(0, 12);
});

test('a slot says what the URDF says, and takes its mesh through mount and scale', () => {
  const model = arm();
  const [slot] = model.slots;
  expect([slot!.link, slot!.uri]).toEqual(['upper', 'package:///arm/Upper.STL']);
  slot!.fill([cube]);
  model.place([0, 0, 0], [1, 0, 0, 0]);
  const box = model.bounds(new Box3());
  expect(box.min.toArray()).toEqual([-0.2, -0.2, -0.1]);
  expect(box.max.z).toBeCloseTo(1, 6);
});

test('colours are those the author of the URDF saw; a mesh without any takes them', () => {
  const model = arm();
  model.slots[0]!.fill([cube, { ...cube, color: new Color(1, 0, 0) }]);
  const shells: MeshStandardMaterial[] = [];
  model.root.traverse((object) => {
    if (object instanceof Mesh) shells.push(object.material);
  });
  expect(shells.map((shell) => shell.color.getHexString())).toEqual(['c4cad3', '808080', 'ff0000']);
  expect(shells.every((shell) => shell.roughness === 0.6)).toBe(true);
});

test('a placeholder takes the place of a mesh, at its link', () => {
  const model = arm();
  const box = new Object3D();
  model.slots[0]!.mark(box);
  expect(box.parent?.name).toBe('upper');
});

test('a ghost is the same meshes in another pose: those that are there, and those that come later', () => {
  const model = arm();
  const ghost = model.ghost();
  const worn = () => {
    const meshes: Mesh[] = [];
    ghost.root.traverse((object) => {
      if (object instanceof Mesh) meshes.push(object);
    });
    return meshes;
  };
  expect(worn().length, 'what the URDF draws itself').toBe(1);
  model.slots[0]!.fill([cube]);
  expect(worn().length).toBe(2);
  const shells = new Set<unknown>();
  model.root.traverse((object) => {
    if (object instanceof Mesh && !worn().includes(object)) shells.add(object.geometry);
  });
  expect(worn().every(({ geometry }) => shells.has(geometry))).toBe(true);

  model.setJoints(angles({ shoulder: 0.3 }));
  expect(ghost.setJoints(angles({ shoulder: 0.3 }))).toBe(true);
  expect(ghost.setJoints(angles({ shoulder: 0.3 }))).toBe(false);
  model.place([1, 2, 3], [1, 0, 0, 0]);
  const upper = worn().find((mesh) => mesh.parent?.name === 'upper')!;
  const body: Mesh[] = [];
  model.root.traverse((object) => {
    if (object instanceof Mesh && object !== upper && object.geometry === upper.geometry) body.push(object);
  });
  const place = (mesh: Mesh) => mesh.matrixWorld.toArray().map((part) => expect.closeTo(part, 9));
  expect(upper.matrixWorld.toArray(), 'where both stand alike').toEqual(place(body[0]!));
  ghost.setJoints(angles({ shoulder: 1.3 }));
  model.root.updateMatrixWorld(true);
  expect(upper.matrixWorld.toArray()).not.toEqual(place(body[0]!));
  expect(model.linkMatrix('upper')!.elements[0], 'the body stays').toBeCloseTo(Math.cos(0.3));

  ghost.setLook('upper', { hide: true });
  expect(upper.visible).toBe(false);
  const down = new Ray(new Vector3(1, 2, 9), new Vector3(0, 0, -1));
  expect(model.pick(down), 'one points at the body').not.toBeNull();
  ghost.dispose();
  expect(ghost.root.parent).toBeNull();
});

const HUBO = resolve(SHARED, 'robots/hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf');

test.skipIf(!existsSync(HUBO))(
  `Hubo 2+ agrees with plain matrices (needs ${HUBO.split('/').slice(-4).join('/')})`,
  () => {
    const text = readFileSync(HUBO, 'utf8');
    const model = new UrdfRobot(text, new Palette(new StaleEffect(new Color()), { value: new Color() }));
    expect(model.problems).toEqual([]);
    expect(model.slots.length).toBe(58);
    for (let round = 0; round < 5; round += 1) {
      const values = angles(
        Object.fromEntries(model.jointNames.map((name, i) => [name, 1.5 * Math.sin(12.9 * i + 7 * round)])),
      );
      model.setJoints(values);
      model.place([0, 0, 0], [1, 0, 0, 0]);
      const expected = forwardKinematics(text, values);
      expect(expected.size).toBe(model.linkNames.length);
      for (const [link, matrix] of expected) {
        const got = model.linkMatrix(link)!.clone().transpose().elements;
        for (let i = 0; i < 12; i += 1) expect(got[i]).toBeCloseTo(matrix[i]!, 6);
      }
    }
  },
);

/** root_from_link, row after row, by nothing but text matching and sums: an independent second opinion. */
function forwardKinematics(text: string, values: ReadonlyMap<string, number>): Map<string, number[]> {
  const joints = [...text.matchAll(/<joint name="([^"]+)" type="([^"]+)"[^>]*>([\s\S]*?)<\/joint>/g)].map(
    ([, name, type, inside]) => {
      const attribute = (tag: string, key: string) =>
        new RegExp(`<${tag}[^>]*\\b${key}="([^"]*)"`).exec(inside!)?.[1];
      const tuple = (tag: string, key: string) =>
        (attribute(tag, key) ?? '0 0 0').trim().split(/\s+/).map(Number);
      return {
        parent: attribute('parent', 'link')!,
        child: attribute('child', 'link')!,
        origin: compose(tuple('origin', 'xyz'), rpy(tuple('origin', 'rpy'))),
        turn:
          type === 'fixed'
            ? compose([0, 0, 0], rpy([0, 0, 0]))
            : compose([0, 0, 0], about(tuple('axis', 'xyz'), values.get(name!) ?? 0)),
      };
    },
  );
  const children = new Set(joints.map((joint) => joint.child));
  const root = joints.find((joint) => !children.has(joint.parent))!.parent;
  const found = new Map([[root, compose([0, 0, 0], rpy([0, 0, 0]))]]);
  for (let pending = joints; pending.length > 0; ) {
    const next = pending.filter((joint) => !found.has(joint.parent));
    if (next.length === pending.length) throw new Error('not a tree');
    for (const joint of pending) {
      const parent = found.get(joint.parent);
      if (parent !== undefined) found.set(joint.child, times(times(parent, joint.origin), joint.turn));
    }
    pending = next;
  }
  return found;
}

function times(a: number[], b: number[]): number[] {
  return Array.from({ length: 16 }, (_, i) =>
    [0, 1, 2, 3].reduce((sum, k) => sum + a[Math.floor(i / 4) * 4 + k]! * b[k * 4 + (i % 4)]!, 0),
  );
}

function compose(xyz: number[], r: number[]): number[] {
  return [
    r[0],
    r[1],
    r[2],
    xyz[0],
    r[3],
    r[4],
    r[5],
    xyz[1],
    r[6],
    r[7],
    r[8],
    xyz[2],
    0,
    0,
    0,
    1,
  ] as number[];
}

/** Roll about x, then pitch about y, then yaw about z, all fixed axes (URDF). */
function rpy(angle: number[]): number[] {
  const [cr, cp, cy] = angle.map(Math.cos) as [number, number, number];
  const [sr, sp, sy] = angle.map(Math.sin) as [number, number, number];
  return [
    cy * cp,
    cy * sp * sr - sy * cr,
    cy * sp * cr + sy * sr,
    sy * cp,
    sy * sp * sr + cy * cr,
    sy * sp * cr - cy * sr,
    -sp,
    cp * sr,
    cp * cr,
  ];
}

/** Rodrigues' formula. */
function about(axis: number[], angle: number): number[] {
  const length = Math.hypot(...axis);
  const [x, y, z] = axis.map((part) => part / length) as [number, number, number];
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  const t = 1 - c;
  return [
    t * x * x + c,
    t * x * y - s * z,
    t * x * z + s * y,
    t * x * y + s * z,
    t * y * y + c,
    t * y * z - s * x,
    t * x * z - s * y,
    t * y * z + s * x,
    t * z * z + c,
  ];
}

test('a planar joint slides and turns across its axis, a floating one goes anywhere; the rest stays', () => {
  const model = new UrdfRobot(
    `<robot name="r"><link name="base"/><link name="cart"/><link name="wall"/><link name="drone"/>
    <joint name="drive" type="planar"><parent link="base"/><child link="cart"/><origin xyz="1 0 0"/><axis xyz="0 0 2"/></joint>
    <joint name="slide" type="planar"><parent link="cart"/><child link="wall"/><axis xyz="0 1 0"/></joint>
    <joint name="fly" type="floating"><parent link="base"/><child link="drone"/><origin xyz="0 0 1"/></joint></robot>`,
    new Palette(new StaleEffect(new Color()), { value: new Color() }),
  );
  expect(model.jointNames.slice(0, 4)).toEqual(['drive/x', 'drive/y', 'drive/theta', 'slide/x']);
  expect(model.jointNames.at(-1)).toBe('fly/rot_w');
  expect(
    model.setJoints(angles({ 'drive/x': 2, 'drive/theta': Math.PI / 2, 'slide/x': 1, 'slide/y': 3 })),
  ).toBe(true);
  expect(model.setJoints(angles({ 'fly/trans_z': 1, 'fly/rot_x': 0 }))).toBe(true);
  expect(model.setJoints(angles({ 'fly/trans_z': 1, 'drive/x': Number.NaN }))).toBe(false);
  model.place([0, 0, 0], [1, 0, 0, 0]);
  expect(at(model, 'cart')).toEqual([3, 0, 0]);
  expect(at(model, 'wall'), 'across y: x, and down').toEqual([3, 1, -3]);
  expect(at(model, 'drone')).toEqual([0, 0, 2]);
});
