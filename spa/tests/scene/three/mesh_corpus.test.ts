// @vitest-environment happy-dom
import { readFileSync } from 'node:fs';
import path from 'node:path';
import { beforeAll, describe, expect, it, vi } from 'vitest';
import { factsOf } from '../../../src/model/report.ts';
import type { LoadedMesh } from '../../../src/scene/three/loaded_mesh.ts';
import { MeshLoader } from '../../../src/scene/three/mesh_loader.ts';

/** Mesh files of many kinds, with what the edge reads in them (edge-agent/tests/test_mesh_corpus.py). */
interface Row {
  readonly name: string;
  readonly main: string;
  readonly files: Readonly<Record<string, string>>;
  readonly reason?: string;
  readonly area: number;
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
  for (const level of ['warn', 'error', 'debug'] as const) vi.spyOn(console, level).mockImplementation(() => {});
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

function areaOf({ parts }: LoadedMesh): number {
  let area = 0;
  for (const { positions: p, index } of parts.map(({ surface }) => surface)) {
    for (let i = 0; i < index.length; i += 3) {
      const [a, b, c] = [index[i]! * 3, index[i + 1]! * 3, index[i + 2]! * 3];
      const [u, v] = [b, c].map((end) => [0, 1, 2].map((axis) => p[end + axis]! - p[a + axis]!));
      const cross = [0, 1, 2].map((axis) => {
        const [j, k] = [(axis + 1) % 3, (axis + 2) % 3];
        return u![j]! * v![k]! - u![k]! * v![j]!;
      });
      area += Math.hypot(...cross) / 2;
    }
  }
  return area;
}

const display = (value: number) => (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
const paintsOf = ({ parts }: LoadedMesh) =>
  [...new Set(parts.map(({ paint }) => paint?.map((value, i) => (i < 3 ? display(value) : value).toFixed(3)).join(' ') ?? ''))].sort();

describe('the page reads meshes like the edge', () => {
  const sound = CORPUS.filter(({ reason }) => reason === undefined);

  it.each(sound.map((row) => [row.name, row] as const))('%s', async (_, row) => {
    const mesh = await read(row);
    if (typeof mesh === 'string') throw new Error(mesh);
    const { low, high } = factsOf(mesh, 0);
    expect(areaOf(mesh)).toBeCloseTo(row.area, 4);
    for (const [i, value] of [...low, ...high].entries()) expect(value).toBeCloseTo(row.box.flat()[i]!, 4);
    expect(mesh.notes.filter(([code]) => !OWN.includes(code))).toEqual(row.notes);
    if (row.paints !== null) {
      expect(paintsOf(mesh)).toEqual(row.paints.map((paint) => paint.map((value) => value.toFixed(3)).join(' ')).sort());
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
