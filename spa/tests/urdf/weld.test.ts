import { expect, test } from 'vitest';
import { weld } from '../../src/urdf/meshes/weld.ts';
import { cubeSoup } from '../rigs/mesh_samples.ts';

function ring(sides: number): Float32Array {
  const soup: number[] = [];
  for (let i = 0; i < sides; i += 1) {
    const [a, b] = [i, i + 1].map((k) => ((k % sides) / sides) * 2 * Math.PI) as [number, number];
    const low = [Math.cos(a), Math.sin(a), 0, Math.cos(b), Math.sin(b), 0];
    const high = [Math.cos(a), Math.sin(a), 1, Math.cos(b), Math.sin(b), 1];
    soup.push(...low, ...high.slice(3), ...low.slice(0, 3), ...high.slice(3), ...high.slice(0, 3));
  }
  return Float32Array.from(soup);
}

test("a cube keeps its edges: three normals at each corner, each a face's own", () => {
  const { positions, normals, index } = weld(cubeSoup());
  expect(index.length).toBe(36);
  expect(positions.length / 3).toBe(24);
  for (let i = 0; i < normals.length; i += 3) {
    const [x, y, z] = normals.slice(i, i + 3);
    expect(Math.max(Math.abs(x!), Math.abs(y!), Math.abs(z!))).toBeCloseTo(1, 6);
    // outwards: along the position
    expect(x! * positions[i]! + y! * positions[i + 1]! + z! * positions[i + 2]!).toBeGreaterThan(0);
  }
});

test('a round wall becomes smooth: one vertex where faces meet, normals along the radius', () => {
  const sides = 24;
  const { positions, normals } = weld(ring(sides));
  expect(positions.length / 3).toBe(2 * sides);
  for (let i = 0; i < normals.length; i += 3) {
    expect(normals[i]).toBeCloseTo(positions[i]!, 1);
    expect(normals[i + 1]).toBeCloseTo(positions[i + 1]!, 1);
    expect(normals[i + 2]).toBeCloseTo(0, 6);
  }
});

test('faces without area and numbers that are not finite are dropped', () => {
  const soup = new Float32Array(cubeSoup().length + 18);
  soup.set(cubeSoup());
  soup.set([Number.NaN, 0, 0, 1, 0, 0, 0, 1, 0], 108);
  const { index, positions } = weld(soup);
  expect(index.length).toBe(36);
  expect(positions.every(Number.isFinite)).toBe(true);
  expect(weld(new Float32Array()).index.length).toBe(0);
});

test('a fan of a thousand faces around one point is welded without comparing each with each', () => {
  const soup: number[] = [];
  for (let i = 0; i < 1000; i += 1) {
    const [a, b] = [i, i + 1].map((k) => (k / 1000) * 2 * Math.PI) as [number, number];
    soup.push(0, 0, 1, Math.cos(a), Math.sin(a), 0, Math.cos(b), Math.sin(b), 0);
  }
  const { index, normals } = weld(Float32Array.from(soup));
  expect(index.length).toBe(3000);
  expect(normals.every(Number.isFinite)).toBe(true);
});
