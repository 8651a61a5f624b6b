import { expect, test } from 'vitest';
import { meshKindOf } from '../../src/urdf/content.ts';
import { MeshError, parseStl } from '../../src/urdf/meshes/stl.ts';
import { asciiStl, binaryStl, cubeSoup } from '../rigs/mesh_samples.ts';

test('binary, ASCII and a binary file that begins with "solid" are one cube', () => {
  const cube = cubeSoup();
  expect(parseStl(binaryStl(cube)).soup).toEqual(cube);
  expect(parseStl(binaryStl(cube, 'solid exported by somebody')).soup).toEqual(cube);
  expect(parseStl(asciiStl(cube)).soup).toEqual(cube);
});

test('a file that claims four billion faces is no STL', () => {
  const bytes = binaryStl(new Float32Array());
  new DataView(bytes.buffer).setUint32(80, 0xffffffff, true);
  expect(meshKindOf(bytes)).toBeNull();
  expect(() => parseStl(bytes)).toThrow('claims 4,294,967,295 triangles, the file has room for 0');
});

test('a few bytes more at the end are forgiven, a page of HTML is not', () => {
  const cube = binaryStl(cubeSoup());
  const longer = new Uint8Array(cube.length + 3);
  longer.set(cube);
  expect(parseStl(longer).soup).toEqual(cubeSoup());
  expect(meshKindOf(new TextEncoder().encode('<!doctype html>'.padEnd(400)))).toBeNull();
});

test('a facet that lacks a corner is an error', () => {
  const text =
    'solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid';
  expect(() => parseStl(new TextEncoder().encode(text))).toThrow(MeshError);
});
