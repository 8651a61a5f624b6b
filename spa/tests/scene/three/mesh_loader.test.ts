// @vitest-environment happy-dom
import { expect, test, vi } from 'vitest';
import type { BundleFile } from '../../../src/model/bundle.ts';
import { factsOf } from '../../../src/model/report.ts';
import { MeshLoader, meshKind } from '../../../src/scene/three/mesh_loader.ts';
import type { Download } from '../../../src/scene/three/raw_bundle.ts';
import { MeshError } from '../../../src/urdf/meshes/stl.ts';
import { asciiStl, binaryStl, collada, cubeSoup, MTL, OBJ, triangleGlb } from '../../rigs/mesh_samples.ts';

const text = (words: string) => new TextEncoder().encode(words.padEnd(200));

test('the bytes decide what a mesh is, not the name of its file', () => {
  expect(meshKind(binaryStl(cubeSoup(), 'solid <COLLADA>'))).toBe('stl');
  expect(meshKind(asciiStl(cubeSoup()))).toBe('stl');
  expect(meshKind(collada())).toBe('collada');
  expect(meshKind(text(OBJ))).toBe('obj');
  expect(meshKind(text('# made by hand\n\nv 0 0 0'))).toBe('obj');
  expect(meshKind(triangleGlb())).toBe('glb');
});

test.each([
  [
    'a web page',
    text('<!DOCTYPE html><html><body>not found</body></html>'),
    'an HTML page, not a mesh: a server answered with a page',
  ],
  ['nothing', new Uint8Array(), 'the file is empty'],
  [
    'another format',
    text('ply\nformat ascii'),
    'a PLY mesh, which is not supported: export it as STL, Collada, OBJ or GLB',
  ],
  ['a half file', binaryStl(cubeSoup()).subarray(0, 300), 'not STL, Collada, OBJ or glTF'],
])('%s is an error, never a crash', (_, bytes, why) => {
  expect(() => meshKind(bytes)).toThrow(new MeshError(why));
});

function loaderOf(bytes: Uint8Array) {
  const fetch = vi.fn(async (_: BundleFile) => bytes);
  const loader = new MeshLoader({ fetch } as unknown as Download);
  return { fetch, load: () => loader.load({ path: 'meshes/x.dae', uri: 'x', size: bytes.length }) };
}

test('one file that ten links show is fetched and read once', async () => {
  const { fetch, load } = loaderOf(binaryStl(cubeSoup()));
  const all = await Promise.all(Array.from({ length: 10 }, load));
  expect(fetch).toHaveBeenCalledTimes(1);
  expect(new Set(all.map(({ parts }) => parts[0]!.surface)).size).toBe(1);
});

test('Collada: the unit counts, the up axis does not, and what is wholly transparent is opaque', async () => {
  vi.spyOn(console, 'warn').mockImplementation(() => {});
  const { parts, notes } = await loaderOf(collada()).load();
  const [part, ...rest] = parts;
  expect(rest).toEqual([]);
  expect(notes).toEqual([
    ['collada-unit', 'its unit is 0.01 m; applied'],
    ['collada-axis', 'it says Y_UP; ignored, as RViz does'],
  ]);
  expect([...part!.surface.positions]).toEqual([0, 0, 0, 1, 0, 0, 0, 0, 1]);
  expect(part!.paint).toEqual([1, 0, 0, 1]);
  const upright = await loaderOf(collada('0.0', 'Z_UP')).load();
  expect(upright.parts[0]!.surface.positions).toEqual(part!.surface.positions);
  expect(upright.notes).toEqual([['collada-unit', 'its unit is 0.01 m; applied']]);
});

test('a Collada glass stays glass', async () => {
  vi.spyOn(console, 'warn').mockImplementation(() => {});
  const { parts } = await loaderOf(collada('0.25')).load();
  const [part] = parts;
  expect(part!.paint![3]).toBeCloseTo(0.25);
});

test('an OBJ has the colours of the library beside it, and none without', async () => {
  const bytes = text(OBJ);
  const file = { path: 'meshes/x.obj', uri: 'x', size: bytes.length };
  const asked: string[] = [];
  const beside = async (_: BundleFile, name: string) => {
    asked.push(name);
    return new TextEncoder().encode(MTL);
  };
  const painted = await new MeshLoader({ fetch: async () => bytes, beside }).load(file);
  expect(asked).toEqual(['paints.mtl']);
  expect(painted.parts.map(({ paint }) => paint)).toContainEqual([1, 0, 0, 1]);
  const plain = await new MeshLoader({ fetch: async () => bytes }).load(file);
  expect(painted.notes.map(([code]) => code)).toEqual(['texture']);
  expect(plain.parts.map(({ paint }) => paint)).toEqual([null]);
  expect(plain.notes).toEqual([['material-file', "its material library 'paints.mtl': no such file"]]);
  expect(plain.parts[0]!.surface.index.length).toBe(6);
});

test('a GLB lies as its nodes put it, with y up, in its colours; its default is no colour', async () => {
  const part = (await loaderOf(triangleGlb()).load()).parts[0];
  expect([...part!.surface.positions]).toEqual([1, 0, 0, 2, 0, 0, 1, 0, 1]);
  expect(part!.paint).toEqual([0, 0, 1, 1]);
  const bare = (await loaderOf(triangleGlb(null)).load()).parts[0];
  expect(bare!.paint).toBeNull();
  await expect(loaderOf(triangleGlb().subarray(0, 60)).load()).rejects.toThrow('meshes/x.dae: ');
});

test('facts: how large a mesh is before the URDF scales it, and what its reader let pass', async () => {
  const tailed = new Uint8Array([...binaryStl(cubeSoup()), 1, 2, 3]);
  const facts = factsOf(await loaderOf(tailed).load(), tailed.length);
  expect(facts).toEqual({
    reason: null,
    bytes: tailed.length,
    triangles: 12,
    low: [-0.5, -0.5, -0.5],
    high: [0.5, 0.5, 0.5],
    notes: [['stl-tail', '3 bytes after the last triangle']],
  });
});

test('what is wrong with a file is one line that names it', async () => {
  const wrong = loaderOf(text('<!DOCTYPE html>')).load();
  await expect(wrong).rejects.toThrow(
    'meshes/x.dae: an HTML page, not a mesh: a server answered with a page',
  );
  const empty = loaderOf(binaryStl(new Float32Array())).load();
  await expect(empty).rejects.toThrow('meshes/x.dae: it has no triangles');
});
