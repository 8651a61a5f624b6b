// @vitest-environment happy-dom
import { existsSync, readFileSync } from 'node:fs';
import { resolve } from 'node:path';
import { Color, Matrix4, type Mesh, Object3D, Ray, Vector3 } from 'three';
import { expect, test, vi } from 'vitest';
import type { BundleFile } from '../../../src/model/bundle.ts';
import type { Lod } from '../../../src/model/lod.ts';
import type { ModelReport } from '../../../src/model/report.ts';
import { fetchUrdf, showRaw } from '../../../src/scene/three/raw_robot.ts';
import { SkinnedRobot } from '../../../src/scene/three/skinned_robot.ts';
import { StaleEffect } from '../../../src/scene/three/stale_effect.ts';
import { modelOf, UrdfError } from '../../../src/urdf/manifest.ts';
import { LodBuilder, type PaintedSurface } from '../../../src/urdf/meshes/lod_builder.ts';
import { ownMesh } from '../../../src/urdf/meshes/primitives.ts';
import { weld } from '../../../src/urdf/meshes/weld.ts';
import { readUrdf } from '../../../src/urdf/reader.ts';
import { readXml } from '../../../src/urdf/xml.ts';
import { jointsAt } from '../../rigs/joints.ts';
import { forwardKinematics } from '../../rigs/kinematics_sample.ts';
import { binaryStl, cubeSoup } from '../../rigs/mesh_samples.ts';

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

/** A robot from a URDF, showing only what the URDF itself describes; meshes are added by hand. */
class Model extends SkinnedRobot {
  readonly urdf: ReturnType<typeof modelOf>;
  readonly lod: LodBuilder;

  constructor(text: string) {
    const urdf = modelOf(readUrdf(readXml(text)));
    const tones = { accent: { value: new Color() }, caution: { value: new Color() } };
    super(urdf.manifest, new StaleEffect(new Color()), tones);
    this.urdf = urdf;
    this.lod = new LodBuilder(urdf.shapes);
    for (const [i, placed] of urdf.shapes.entries())
      if (placed.shape.kind !== 'mesh') this.put(i, ownMesh(placed));
  }

  put(visual: number, mesh: readonly PaintedSurface[]): void {
    this.measure(this.urdf.manifest.visuals[visual]!.link, this.lod.put(visual, mesh));
    this.wear(this.lod.build(), []);
  }
}

function arm(): Model {
  const model = new Model(ARM);
  model.place([0, 0, 0], [1, 0, 0, 0]);
  return model;
}

/** The number of the visual that shows the arm's mesh. */
const UPPER = 1;

/** world_from_link. */
const matrixOf = (model: SkinnedRobot, link: string) =>
  new Matrix4().fromArray(model.linkMatrix(link)!.elements);

function at(model: SkinnedRobot, link: string): number[] {
  const m = model.linkMatrix(link)!.elements;
  return [m[12]!, m[13]!, m[14]!].map((value) => Math.round(value * 1e6) / 1e6 + 0);
}

const cube: PaintedSurface = { surface: weld(cubeSoup()), paint: null };

test('limits do not clamp what a robot reports, a follower follows with its offset', () => {
  const model = arm();
  expect(model.jointNames).toEqual(['shoulder', 'elbow', 'rod']);
  expect(model.setJoints(jointsAt({ shoulder: Math.PI / 2, rod: 0.5 }))).toBe(true);
  model.place([0, 0, 0], [1, 0, 0, 0]);
  const bend = Math.PI / 2 - Math.PI + 0.1;
  expect(at(model, 'lower')).toEqual([1, 0, 0]);
  expect(at(model, 'slide')[0]).toBeCloseTo(1 + 0.5 * Math.sin(bend), 5);
  expect(at(model, 'slide')[2]).toBeCloseTo(0.5 * Math.cos(bend), 5);
});

test('where the robot reports the follower itself, that reading wins', () => {
  const model = arm();
  model.setJoints(jointsAt({ elbow: 0, shoulder: Math.PI / 2, rod: 1 }));
  model.place([0, 0, 0], [1, 0, 0, 0]);
  expect(at(model, 'slide')).toEqual([2, 0, 0]);
});

test('the same angles again, no reading, and joints nobody has change nothing', () => {
  const model = arm();
  expect(model.setJoints(jointsAt({ shoulder: 0.3 }))).toBe(true);
  expect(model.setJoints(jointsAt({ shoulder: 0.3 }))).toBe(false);
  expect(model.setJoints(jointsAt({ shoulder: Number.NaN, tail: 1 }))).toBe(false);
  expect(model.setJoints(jointsAt({}))).toBe(false);
  model.setJoints(jointsAt({ rod: 1 }));
  model.place([0, 0, 0], [1, 0, 0, 0]);
  expect(at(model, 'lower')[0]).toBeCloseTo(Math.sin(0.3), 5);
});

test('without a base it stands on its lowest point; with one it is where the base says', () => {
  const model = arm();
  model.ground();
  expect(at(model, 'base')).toEqual([0, 0, 0.1]);
  model.setJoints(jointsAt({ shoulder: Math.PI }));
  model.put(UPPER, [cube]);
  model.ground();
  expect(at(model, 'base')).toEqual([0, 0, 1]);
  model.place([1, 2, 3], [2, 0, 0, 2]);
  expect(at(model, 'base')).toEqual([1, 2, 3]);
  expect(model.linkMatrix('base')!.elements[0]).toBeCloseTo(0, 12);
});

test('a slot says what the URDF says, and takes its mesh through mount and scale', () => {
  const model = arm();
  const { link, source } = model.urdf.manifest.visuals[UPPER]!;
  expect([model.linkNames[link], source]).toEqual(['upper', 'package:///arm/Upper.STL']);
  model.put(UPPER, [cube]);
  model.place([0, 0, 0], [1, 0, 0, 0]);
  const box = model.bounds();
  expect(box.min).toEqual([-0.2, -0.2, -0.1].map((part) => expect.closeTo(part, 6)));
  expect(box.max[2]).toBeCloseTo(1, 6);
});

test('colours are those the author of the URDF saw; a mesh without any takes them', () => {
  const model = arm();
  model.put(UPPER, [cube, { ...cube, paint: [1, 0, 0, 1] }]);
  const { paints } = model.lod.build();
  const hex = (at: number) => new Color(...paints.subarray(at, at + 3)).getHexString();
  expect([0, 4, 8].map(hex)).toEqual(['c4cad3', '808080', 'ff0000']);
});

test('a placeholder takes the place of a mesh, at its link, and is pointed at as the mesh would be', () => {
  const model = arm();
  const box = new Object3D();
  box.scale.setScalar(0.2);
  model.mark(1, box);
  model.setJoints(jointsAt({ shoulder: Math.PI / 2 }));
  model.place([1, 2, 3], [1, 0, 0, 0]);
  model.root.updateMatrixWorld(true);
  const { elements } = matrixOf(model, 'upper').scale(box.scale);
  expect(box.matrixWorld.toArray()).toEqual(elements.map((part) => expect.closeTo(part, 9)));
  const other = new Object3D();
  other.scale.setScalar(0.2);
  model.mark(2, other);
  expect(model.pick(new Ray(new Vector3(2, 2, 9), new Vector3(0, 0, -1)))).toBe('lower');
  expect(model.pick(new Ray(new Vector3(5, 2, 9), new Vector3(0, 0, -1)))).toBeNull();
});

test('a ghost is the same meshes in another pose: those that are there, and those that come later', () => {
  const model = arm();
  const ghost = model.ghost();
  const body = () => model.root.children.find((child) => child !== ghost.mesh) as Mesh;
  const drawn = () => ghost.mesh.geometry.getIndex()!.count / 3;
  expect(drawn(), 'what the URDF draws itself').toBe(12);
  model.put(UPPER, [cube]);
  expect(drawn()).toBe(24);
  expect(ghost.mesh.geometry).toBe(body().geometry);

  model.setJoints(jointsAt({ shoulder: 0.3 }));
  expect(ghost.setJoints(jointsAt({ shoulder: 0.3 }))).toBe(true);
  expect(ghost.setJoints(jointsAt({ shoulder: 0.3 }))).toBe(false);
  model.place([1, 2, 3], [1, 0, 0, 0]);
  const upper = () => [...ghost.rootFromLink.slice(16, 32)];
  const ofBody = matrixOf(model, 'upper')
    .premultiply(model.root.matrixWorld.clone().invert())
    .elements.map((part) => expect.closeTo(part, 9));
  expect(upper(), 'where both stand alike').toEqual(ofBody);
  ghost.setJoints(jointsAt({ shoulder: 1.3 }));
  expect(upper()).not.toEqual(ofBody);
  expect(model.linkMatrix('upper')!.elements[0], 'the body stays').toBeCloseTo(Math.cos(0.3));

  ghost.setLook('upper', { hide: true });
  const down = new Ray(new Vector3(1, 2, 9), new Vector3(0, 0, -1));
  expect(model.pick(down), 'one points at the body').not.toBeNull();
  ghost.dispose();
  expect(ghost.mesh.parent).toBeNull();
});

/** Corners in the link's frame, as uploaded to the GPU, with their normals. */
function cornersOf(lod: Lod, visual: number): { at: number[]; normal: number[] }[] {
  const m = lod.linkFromMesh.subarray(visual * 16, visual * 16 + 16);
  const [start = 0, count = 0] = lod.ranges[visual]!;
  return [...lod.index.subarray(start, start + count)].map((vertex) => {
    const [x, y, z] = lod.positions.subarray(vertex * 4, vertex * 4 + 3) as unknown as [
      number,
      number,
      number,
    ];
    const at = [0, 1, 2].map((row) => m[row]! * x + m[row + 4]! * y + m[row + 8]! * z + m[row + 12]!);
    return { at, normal: [...lod.normals.subarray(vertex * 4, vertex * 4 + 3)].map((part) => part / 127) };
  });
}

test('a stretched or mirrored mesh keeps its size to a thousandth of a millimetre, and looks outwards', () => {
  for (const scale of ['0.2 0.4 0.1', '0.2 -0.4 0.1', '-1 -1 -1']) {
    const model = new Model(ARM.replace('0.1 0.1 1', scale));
    model.put(UPPER, [cube]);
    const corners = cornersOf(model.lod.build(), UPPER);
    expect(corners.length).toBe(36);
    const edges = scale.split(' ').map((part) => Math.abs(Number(part)) / 2);
    for (let i = 0; i < corners.length; i += 3) {
      const [a, b, c] = corners.slice(i, i + 3).map(({ at: [x, y, z] }) => new Vector3(x, y, z! - 0.5)) as [
        Vector3,
        Vector3,
        Vector3,
      ];
      for (const [axis, edge] of edges.entries()) expect(Math.abs(a.getComponent(axis))).toBeCloseTo(edge, 5);
      const face = b.clone().sub(a).cross(c.clone().sub(a));
      expect(face.dot(a), 'outwards').toBeGreaterThan(0);
      expect(face.dot(new Vector3(...(corners[i]!.normal as [number, number, number])))).toBeGreaterThan(0);
    }
  }
});

test('one mesh that two thousand visuals show is stored once and bounded where it is drawn', () => {
  const visuals = '<visual><geometry><mesh filename="a.stl"/></geometry></visual>'.repeat(2000);
  const { shapes } = modelOf(readUrdf(readXml(`<robot name="r"><link name="a">${visuals}</link></robot>`)));
  const lod = new LodBuilder(shapes);
  const large = [
    {
      surface: {
        positions: new Float32Array(3e6),
        normals: new Float32Array(3e6),
        index: new Uint32Array(3e6),
      },
      paint: null,
    },
  ];
  let shown = 0;
  expect(() => {
    for (; shown < shapes.length; shown += 1) lod.put(shown, large);
  }).toThrow('left out: the robot already unpacks to too many bytes');
  expect(shown).toBe(14);
});

test('sixty meshes are seen as they come, from the floor up, in a few pictures; one that is missing is marked', async () => {
  const link = (i: number) =>
    `<link name="l${i}"><visual><geometry><mesh filename="${i}.stl"/></geometry></visual></link>`;
  const joint = (i: number) =>
    `<joint name="j${i}" type="fixed"><parent link="l${i - 1}"/><child link="l${i}"/><origin xyz="0 0 -1"/></joint>`;
  const all = Array.from({ length: 60 }, (_, i) => i);
  const urdf = readUrdf(
    readXml(`<robot name="r">${all.map(link).join('')}${all.slice(1).map(joint).join('')}</robot>`),
  );
  const asked: string[] = [];
  let line: Promise<unknown> = Promise.resolve();
  const fetch = async ({ path }: BundleFile) => {
    asked.push(path);
    line = line.then(() => new Promise((resolve) => setImmediate(resolve))); // one after the other
    await line;
    return binaryStl(cubeSoup());
  };
  const file = (i: number) => [`${i}.stl`, { path: `${i}.stl`, uri: `${i}.stl`, size: 684 }] as const;
  const manifest = {
    urdf: { path: 'r.urdf', uri: 'r.urdf', size: 100 },
    files: new Map(all.slice(1).map(file)),
    missing: new Set(['0.stl']),
  };
  const stage = {
    signal: new AbortController().signal,
    show: (robot: SkinnedRobot) => robot.place([0, 0, 0], [1, 0, 0, 0]),
    skinned: vi.fn(),
    changed: vi.fn(),
    placeholder: vi.fn(() => new Object3D()),
  };
  const wear = vi.spyOn(SkinnedRobot.prototype, 'wear');
  const report: ModelReport = { missing: [], joints: [], ignored: [], problems: [] };
  const tones = { accent: { value: new Color() }, caution: { value: new Color() } };
  const totals: number[] = [];
  await showRaw(
    { urdf, manifest, files: { fetch } },
    stage,
    new StaleEffect(new Color()),
    tones,
    report,
    (total) => totals.push(total),
  );
  expect(totals).toEqual([100 + 59 * 684]);
  expect(asked).toEqual(
    all
      .slice(1)
      .reverse()
      .map((i) => `${i}.stl`),
  );
  const triangles = wear.mock.calls.map(([level]) => level.index.length / 3);
  expect(triangles).toEqual([1, 2, 4, 8, 16, 32, 59].map((count) => count * 12));
  expect(stage.placeholder).toHaveBeenCalledTimes(1);
  expect(stage.skinned).toHaveBeenCalledTimes(1);
  expect(report.missing).toEqual(['0.stl']);
  expect(report.problems).toEqual(['0.stl: not found by the robot']);
  expect(report.meshes?.get('7.stl')?.triangles).toBe(12);
  wear.mockRestore();
});

test('a shape without end is named and not drawn, and no box is broken by it', () => {
  const box = '<visual><geometry><box size="1e300 1 1"/></geometry></visual>';
  const { shapes } = modelOf(readUrdf(readXml(`<robot name="r"><link name="a">${box}</link></robot>`)));
  const mesh = ownMesh(shapes[0]!);
  expect(() => new LodBuilder(shapes).put(0, mesh)).toThrow('too large to draw');
});

test.each([
  ['not XML', '<robot>\n<link name="a></robot>', /^URDF: error on line 2/],
  ['empty', '', /^URDF: the file is empty$/],
  ['a web page', '<html><body/></html>', /^URDF: an HTML page, not a robot description: /],
])('%s is no URDF', async (_, text, why) => {
  const urdf = { path: 'r.urdf', uri: 'r.urdf', size: text.length };
  const fetched = fetchUrdf(
    { urdf, files: new Map(), missing: new Set() },
    { fetch: async () => new TextEncoder().encode(text) },
  );
  await expect(fetched).rejects.toThrow(UrdfError);
  await expect(fetched).rejects.toThrow(why);
});

const HUBO = resolve(SHARED, 'robots/hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf');

test.skipIf(!existsSync(HUBO))(
  `Hubo 2+ agrees with plain matrices (needs ${HUBO.split('/').slice(-4).join('/')})`,
  () => {
    const text = readFileSync(HUBO, 'utf8');
    const model = new Model(text);
    expect(model.urdf.problems).toEqual([]);
    expect(model.urdf.shapes.filter(({ shape }) => shape.kind === 'mesh').length).toBe(58);
    for (let round = 0; round < 5; round += 1) {
      const values = jointsAt(
        Object.fromEntries(model.jointNames.map((name, i) => [name, 1.5 * Math.sin(12.9 * i + 7 * round)])),
      );
      model.setJoints(values);
      model.place([0, 0, 0], [1, 0, 0, 0]);
      const expected = forwardKinematics(text, values);
      expect(expected.size).toBe(model.linkNames.length);
      for (const [link, matrix] of expected) {
        const got = matrixOf(model, link).transpose().elements;
        for (let i = 0; i < 12; i += 1) expect(got[i]).toBeCloseTo(matrix[i]!, 6);
      }
    }
  },
);

test('a planar joint slides and turns across its axis, a floating one goes anywhere; the rest stays', () => {
  const model = new Model(
    `<robot name="r"><link name="base"/><link name="cart"/><link name="wall"/><link name="drone"/>
    <joint name="drive" type="planar"><parent link="base"/><child link="cart"/><origin xyz="1 0 0"/><axis xyz="0 0 2"/></joint>
    <joint name="slide" type="planar"><parent link="cart"/><child link="wall"/><axis xyz="0 1 0"/></joint>
    <joint name="fly" type="floating"><parent link="base"/><child link="drone"/><origin xyz="0 0 1"/></joint></robot>`,
  );
  expect(model.jointNames.slice(0, 4)).toEqual(['drive/x', 'drive/y', 'drive/theta', 'slide/x']);
  expect(model.jointNames.at(-1)).toBe('fly/rot_w');
  expect(
    model.setJoints(jointsAt({ 'drive/x': 2, 'drive/theta': Math.PI / 2, 'slide/x': 1, 'slide/y': 3 })),
  ).toBe(true);
  expect(model.setJoints(jointsAt({ 'fly/trans_z': 1, 'fly/rot_x': 0 }))).toBe(true);
  expect(model.setJoints(jointsAt({ 'fly/trans_z': 1, 'drive/x': Number.NaN }))).toBe(false);
  model.place([0, 0, 0], [1, 0, 0, 0]);
  expect(at(model, 'cart')).toEqual([3, 0, 0]);
  expect(at(model, 'wall'), 'across y: x, and down').toEqual([3, 1, -3]);
  expect(at(model, 'drone')).toEqual([0, 0, 2]);
});
