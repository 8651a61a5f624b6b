// @vitest-environment happy-dom
import { readFileSync } from 'node:fs';
import path from 'node:path';
import { beforeAll, describe, expect, it, test, vi } from 'vitest';
import { factsOf, type MeshNote } from '../../../src/model/report.ts';
import type { LoadedMesh } from '../../../src/scene/three/loaded_mesh.ts';
import { MeshLoader } from '../../../src/scene/three/mesh_loader.ts';
import { PolygonCutter } from '../../../src/scene/three/polygons.ts';

/** Mesh files of many kinds, with what the edge reads in them (edge-agent/tests/test_mesh_corpus.py). */
interface Row {
  readonly name: string;
  readonly main: string;
  readonly files: Readonly<Record<string, string>>;
  readonly reason?: string;
  readonly area: number;
  /** The sum of its triangles' normals, each as long as the triangle's area: where it faces. */
  readonly faces: readonly number[];
  readonly box: readonly (readonly number[])[];
  /** Display values; empty for the URDF's own colour. Null if a picture gives the colour, which the page does not draw. */
  readonly paints: readonly (readonly number[])[] | null;
  readonly notes: readonly (readonly [string, string])[];
}

const CORPUS = JSON.parse(
  readFileSync(path.resolve(import.meta.dirname, '../../../../edge-agent/tests/mesh_corpus.json'), 'utf8'),
) as readonly Row[];
/** Notes that the two readers word on their own. */
const OWN = ['texture', 'material-file', 'collada-opacity'];
const NO_SENTENCE = /Error|THREE|undefined|Cannot|is not a function|null|Unexpected|Invalid/;

beforeAll(() => {
  for (const level of ['warn', 'error', 'debug'] as const)
    vi.spyOn(console, level).mockImplementation(() => {});
});

async function read({ main, files }: Row): Promise<LoadedMesh | string> {
  const bytesOf = (name: string) => {
    const text = files[name] ?? files[name.toLowerCase()]; // as files on the page are found
    return text === undefined ? null : Uint8Array.from(Buffer.from(text, 'base64'));
  };
  const loader = new MeshLoader({
    fetch: async () => bytesOf(main)!,
    beside: async (_, name) => bytesOf(name),
  });
  try {
    return await loader.load({ path: main, uri: main, size: 0 });
  } catch (cause) {
    return (cause as Error).message.replace(`${main}: `, '');
  }
}

function measure({ parts }: LoadedMesh): { area: number; faces: number[] } {
  let area = 0;
  const faces = [0, 0, 0];
  for (const { positions: p, index } of parts.map(({ surface }) => surface)) {
    for (let i = 0; i < index.length; i += 3) {
      const [a, b, c] = [index[i]! * 3, index[i + 1]! * 3, index[i + 2]! * 3];
      const [u, v] = [b, c].map((end) => [0, 1, 2].map((axis) => p[end + axis]! - p[a + axis]!));
      const cross = [0, 1, 2].map((axis) => {
        const [j, k] = [(axis + 1) % 3, (axis + 2) % 3];
        return u![j]! * v![k]! - u![k]! * v![j]!;
      });
      area += Math.hypot(...cross) / 2;
      for (const axis of [0, 1, 2]) faces[axis]! += cross[axis]! / 2;
    }
  }
  return { area, faces };
}

const display = (value: number) => (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
const paintsOf = ({ parts }: LoadedMesh) =>
  [
    ...new Set(
      parts.map(
        ({ paint }) => paint?.map((value, i) => (i < 3 ? display(value) : value).toFixed(3)).join(' ') ?? '',
      ),
    ),
  ].sort();

describe('the page reads meshes like the edge', () => {
  const sound = CORPUS.filter(({ reason }) => reason === undefined);

  it.each(sound.map((row) => [row.name, row] as const))('%s', async (_, row) => {
    const mesh = await read(row);
    if (typeof mesh === 'string') throw new Error(mesh);
    const { low, high } = factsOf(mesh, 0);
    const { area, faces } = measure(mesh);
    for (const [i, value] of [area, ...faces].entries())
      expect(value).toBeCloseTo([row.area, ...row.faces][i]!, 4);
    for (const [i, value] of [...low, ...high].entries()) expect(value).toBeCloseTo(row.box.flat()[i]!, 4);
    expect(mesh.notes.filter(([code]) => !OWN.includes(code))).toEqual(row.notes);
    if (row.paints !== null) {
      expect(paintsOf(mesh)).toEqual(
        row.paints.map((paint) => paint.map((value) => value.toFixed(3)).join(' ')).sort(),
      );
    }
  });

  it.each(CORPUS.filter(({ reason }) => reason !== undefined).map((row) => [row.name, row] as const))(
    'refuses by a sentence: %s',
    async (_, row) => {
      const reason = await read(row);
      expect(reason).toBeTypeOf('string');
      expect(reason).not.toMatch(NO_SENTENCE);
      if (row.name.startsWith('glTF needs')) expect(reason).toBe(row.reason);
    },
  );
});

const SPOILT = [
  'a cube as glTF: y is up',
  'glTF picture: offset and scale',
  'OBJ of a prism',
  'OBJ: two libraries on a line',
  'Collada polylist: U',
  'Collada hole: two',
  'a text STL',
  'a binary STL',
];

/** Numbers that look random and are the same in every run (mulberry32). */
function chanceOf(seed: number): (below: number) => number {
  let state = seed;
  return (below) => {
    state = (state + 0x6d2b79f5) | 0;
    let t = Math.imul(state ^ (state >>> 15), 1 | state);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) % below;
  };
}

test.each(SPOILT)('whatever is spoilt gives a sentence: %s', async (name) => {
  const row = CORPUS.find((each) => each.name === name)!;
  const chance = chanceOf(name.length);
  let refused = 0;
  for (let i = 0; i < 60; i += 1) {
    const bytes = [...Buffer.from(row.files[row.main]!, 'base64')];
    const at = chance(bytes.length);
    const kind = chance(4);
    if (kind === 0) bytes.splice(at);
    else if (kind === 1) bytes.splice(at, 1 + chance(40));
    else if (kind === 2) bytes.splice(at, 0, ...bytes.slice(at, at + 40));
    else bytes[at] = '0az"<{[-.\0'.charCodeAt(chance(10));
    const files = { ...row.files, [row.main]: Buffer.from(bytes).toString('base64') };
    const mesh = await read({ ...row, files });
    const said = typeof mesh === 'string' ? [mesh] : mesh.notes.map(([, text]) => text);
    for (const text of said) expect(text).not.toMatch(NO_SENTENCE);
    if (typeof mesh === 'string') refused += 1;
  }
  expect(refused).toBeGreaterThan(0);
});

test('cutting ears is bounded: notches of a polygon with too many corners are filled, and that is said once', () => {
  const notes: MeshNote[] = [];
  const cutter = new PolygonCutter(notes);
  const jagged = (teeth: number) => [
    ...Array.from({ length: teeth }, (_, i) => [i, 1 + (i % 2), 0] as const),
    ...([
      [teeth, 0, 0],
      [0, 0, 0],
    ] as const),
  ];
  expect(cutter.cut(jagged(60))).toHaveLength(3 * 60);
  expect(notes).toEqual([]);
  for (let i = 0; i < 2; i += 1) expect(cutter.cut(jagged(10_000)).slice(0, 6)).toEqual([0, 1, 2, 0, 2, 3]);
  expect(notes).toEqual([['polygon', 'polygons with too many corners; their notches and holes are filled']]);
});
