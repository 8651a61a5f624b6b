// @vitest-environment happy-dom
import { Color } from 'three';
import { expect, test, vi } from 'vitest';
import type { BundleFile, Download } from './bundle.ts';
import { MeshLoader, meshKind } from './mesh_loader.ts';
import { asciiStl, binaryStl, collada, cubeSoup } from './mesh_samples.ts';
import { MeshError } from './stl.ts';

const text = (words: string) => new TextEncoder().encode(words.padEnd(200));

test('the bytes decide what a mesh is, not the name of its file', () => {
  expect(meshKind(binaryStl(cubeSoup(), 'solid <COLLADA>'))).toBe('stl');
  expect(meshKind(asciiStl(cubeSoup()))).toBe('stl');
  expect(meshKind(collada())).toBe('collada');
});

test.each([
  [
    'a web page',
    text('<!DOCTYPE html><html><body>not found</body></html>'),
    'a web page came instead of a mesh',
  ],
  ['nothing', new Uint8Array(), 'empty'],
  ['another format', text('glTF\x02'), 'neither STL nor Collada'],
  ['a half file', binaryStl(cubeSoup()).subarray(0, 300), 'neither STL nor Collada'],
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
  expect(new Set(all.map((parts) => parts[0]!.surface)).size).toBe(1);
});

test('Collada: the unit counts, the up axis does not, and what is wholly transparent is opaque', async () => {
  vi.spyOn(console, 'warn').mockImplementation(() => {});
  const [part, ...rest] = await loaderOf(collada()).load();
  expect(rest).toEqual([]);
  expect([...part!.surface.positions]).toEqual([0, 0, 0, 1, 0, 0, 0, 0, 1]);
  expect(part!.color).toEqual(new Color(1, 0, 0));
  expect(part!.opacity).toBe(1);
});

test('a Collada glass stays glass', async () => {
  vi.spyOn(console, 'warn').mockImplementation(() => {});
  const [part] = await loaderOf(collada('0.25')).load();
  expect(part!.opacity).toBeCloseTo(0.25);
});

test('what is wrong with a file is one line that names it', async () => {
  const wrong = loaderOf(text('<!DOCTYPE html>')).load();
  await expect(wrong).rejects.toThrow('meshes/x.dae: a web page came instead of a mesh');
  const empty = loaderOf(binaryStl(new Float32Array())).load();
  await expect(empty).rejects.toThrow('meshes/x.dae: no triangles');
});
