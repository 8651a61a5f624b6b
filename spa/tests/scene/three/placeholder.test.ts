import { Color, type LineBasicMaterial } from 'three';
import { expect, test } from 'vitest';
import { parseManifest } from '../../../src/model/bundle.ts';
import { hatchedBox, Placeholders, whyAbsent } from '../../../src/scene/three/placeholder.ts';
import { readRawManifest } from '../../../src/scene/three/raw_bundle.ts';

test('a mesh is absent when the edge says so, or when the bundle does not have it', () => {
  const files = [
    { path: 'r.urdf', uri: 'r.urdf', size: 1 },
    { path: 'a.stl', uri: 'package://x/a.stl', size: 1 },
  ];
  const manifest = readRawManifest(
    parseManifest(JSON.stringify({ v: 1, urdf: 'r.urdf', files, missing: ['package://x/b.stl'] })),
  );
  expect(whyAbsent('package://x/a.stl', manifest)).toBeNull();
  expect(whyAbsent('package://x/b.stl', manifest)).toBe('not found by the robot');
  expect(whyAbsent('a.stl', manifest)).toBe('not in the bundle');
});

test('the box is twelve edges and hatches, all on its surface', () => {
  const points = hatchedBox();
  expect(points.length / 6).toBe(6 * (2 + 7));
  for (let i = 0; i < points.length; i += 3) {
    const reach = Math.max(...[0, 1, 2].map((k) => Math.abs(points[i + k]!)));
    expect(reach).toBeCloseTo(0.5, 6);
  }
});

test('all boxes of a robot share one geometry and one colour', () => {
  const placeholders = new Placeholders();
  const [a, b] = [placeholders.make(0.1), placeholders.make(0.2)];
  placeholders.setColor(new Color(0xf5b83d));
  expect(a.geometry).toBe(b.geometry);
  expect((b.material as LineBasicMaterial).color.getHex()).toBe(0xf5b83d);
  expect(b.scale.x).toBe(0.2);
});
