import { expect, test } from 'vitest';
import { Glb, GlbError } from '../../src/model/glb.ts';
import { readLod, STAND_IN } from '../../src/model/lod.ts';
import { type SampleModel, sampleGlb } from '../rigs/model_samples.ts';

const PICTURE = Uint8Array.from([0x89, 0x50, 0x4e, 0x47]);
const model: SampleModel = {
  joints: [],
  visuals: [
    { link: 0, size: [0.2, 0.4, 0.6], material: 0 },
    { link: 0, size: [0.1, 0.1, 0.1], material: 1, at: [1, 2, 3] },
    { link: 0, size: [0.1, 0.1, 0.1], material: 2, mesh: 1 },
    { link: 0, size: [0.1, 0.1, 0.1], mesh: 1, at: [5, 0, 0] },
    { link: 0, material: 3 },
  ],
  materials: [
    { color: [1, 0, 0, 1] },
    { color: [0, 1, 0, 0.5], picture: 0 },
    { color: [0, 0, 1, 1] },
    { color: [1, 1, 1, 1], placeholder: true },
  ],
  pictures: [PICTURE],
};

test('visuals become one set of arrays, each vertex with its bone and its paint', async () => {
  const level = await readLod(await sampleGlb(model), 5);
  expect(level.positions.length).toBe(5 * 24 * 4); // the shared mesh twice
  const bones = Array.from({ length: 5 * 24 }, (_, i) => level.parts[i * 2]!);
  const paints = Array.from({ length: 5 * 24 }, (_, i) => level.parts[i * 2 + 1]!);
  expect(bones).toEqual([0, 1, 2, 3, 4].flatMap((bone) => Array<number>(24).fill(bone)));
  expect(paints).toEqual([0, 1, 2, 2, 3].flatMap((paint) => Array<number>(24).fill(paint)));
  expect([...level.boxes.subarray(0, 6)]).toEqual([-100, -200, -300, 100, 200, 300]);
  expect([...level.linkFromMesh.subarray(16, 32)].slice(12, 15)).toEqual([1, 2, 3]);
  expect([...level.paints].slice(0, 16)).toEqual([1, 0, 0, 1, 0, 1, 0, 0.5, 0, 0, 1, 1, 1, 1, 1, STAND_IN]);
});

test('a model that is not packed is the same model', async () => {
  expect(await readLod(await sampleGlb({ ...model, unpacked: true }), 5)).toEqual(
    await readLod(await sampleGlb(model), 5),
  );
});

test('one draw for all that is untextured, one more for each picture; all triangles belong to somebody', async () => {
  const level = await readLod(await sampleGlb(model), 5);
  expect(level.draws).toEqual([
    { start: 0, count: 4 * 36, picture: null },
    { start: 4 * 36, count: 36, picture: 0 },
  ]);
  expect(level.pictures.map(({ size, type }) => [size, type])).toEqual([[4, 'image/png']]);
  for (const [bone, ranges] of level.ranges.entries()) {
    for (let r = 0; r < ranges.length; r += 2) {
      for (let i = ranges[r]!; i < ranges[r]! + ranges[r + 1]!; i += 1) {
        expect(level.parts[level.index[i]! * 2]).toBe(bone);
      }
    }
  }
});

/** The sample with its JSON changed. */
async function changed(change: (json: Record<string, unknown>) => void): Promise<Uint8Array> {
  const bytes = await sampleGlb({ joints: [], visuals: [{ link: 0 }] });
  const data = new DataView(bytes.buffer);
  const length = data.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + length)));
  change(json);
  const text = new TextEncoder().encode(JSON.stringify(json).padEnd(length + 400));
  const rest = bytes.subarray(20 + length);
  const whole = new Uint8Array(20 + text.length + rest.length);
  whole.set(bytes.subarray(0, 20));
  new DataView(whole.buffer).setUint32(12, text.length, true);
  whole.set(text, 20);
  whole.set(rest, 20 + text.length);
  return whole;
}

/** Sets one value in a document, by its path. */
function put(json: Record<string, unknown>, path: string, value: unknown): void {
  const steps = path.split('/');
  const last = steps.pop()!;
  let at = json;
  for (const step of steps) at = at[step] as Record<string, unknown>;
  at[last] = value;
}

const PACKED = 'bufferViews/0/extensions/EXT_meshopt_compression';

test.each<[string, string, unknown, string]>([
  ['too many nodes', 'nodes/1', {}, '2 nodes for 1 visuals'],
  ['a node nowhere', 'nodes/0/translation', [0, 'x', 0], 'a node without a valid position'],
  ['a mesh that is not there', 'nodes/0/mesh', 7, 'no mesh 7'],
  ['a range past the end', 'meshes/0/primitives/0/extras/count', 1e9, 'past the last vertex'],
  ['triangles outside', 'meshes/0/primitives/0/extras/count', 3, 'outside its mesh'],
  ['floats', 'accessors/0/componentType', 5126, 'not quantised'],
  ['an accessor past the end', 'accessors/2/count', 36e6, 'past the end'],
  ['a giant', `${PACKED}/count`, 1e12, 'too many bytes'],
  ['a stride of nothing', `${PACKED}/byteStride`, 0, 'unknown packing'],
  ['an unknown packing', `${PACKED}/mode`, '__proto__', 'unknown packing'],
  ['a filter', `${PACKED}/filter`, 'OCTAHEDRAL', 'unknown packing'],
  ['damaged packing', `${PACKED}/byteOffset`, 1, 'damaged'],
])('%s is refused in one line', async (_, path, value, why) => {
  await expect(readLod(await changed((json) => put(json, path, value)), 1)).rejects.toThrow(why);
});

test('a page, an empty file and a cut one are no levels', async () => {
  const page = new TextEncoder().encode('<!doctype html><html><body>not found</body></html>');
  const whole = await sampleGlb({ joints: [], visuals: [{ link: 0 }] });
  for (const bytes of [page, new Uint8Array(), whole.subarray(0, 400)]) {
    await expect(Glb.read(bytes)).rejects.toThrow(GlbError);
  }
});
