// @vitest-environment happy-dom
import { readFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it, vi } from 'vitest';
import { factsOf } from '../../src/model/report.ts';
import { MeshLoader } from '../../src/scene/three/mesh_loader.ts';
import { FileFinder } from '../../src/urdf/file_finder.ts';
import type { LocalFile } from '../../src/urdf/local_files.ts';
import { parseUrdf } from '../../src/urdf/reader.ts';
import { readRobotText } from '../../src/urdf/text.ts';
import { XmlRefused } from '../../src/urdf/xml.ts';

/** What the agent makes of strangers' files (edge-agent/tests/test_reading_corpus.py). Bytes are written as characters. */
interface Corpus {
  readonly texts: readonly {
    readonly what: string;
    readonly bytes: string;
    readonly name?: string;
    readonly links?: readonly string[];
    readonly findings?: readonly unknown[];
    readonly refused?: string;
  }[];
  readonly meshes: readonly {
    readonly file: string;
    readonly bytes: string;
    readonly triangles?: number;
    readonly notes?: readonly unknown[];
    readonly refused?: string;
  }[];
  readonly names: readonly {
    readonly files: readonly string[];
    readonly urdf: string;
    readonly found: Readonly<Record<string, [path: string | null, why: string | null]>>;
  }[];
}

const CORPUS = JSON.parse(
  readFileSync(path.resolve(import.meta.dirname, '../../../edge-agent/tests/reading_corpus.json'), 'utf8'),
) as Corpus;
const bytesOf = (text: string) => Uint8Array.from(text, (letter) => letter.charCodeAt(0));

describe('the page reads what the agent reads', () => {
  it.each(CORPUS.texts.map((row) => [row.what, row] as const))('a text: %s', (_, row) => {
    const { what, bytes, ...expected } = row;
    let read: unknown;
    try {
      const { name, links, findings } = parseUrdf(readRobotText(bytesOf(bytes)));
      const said = findings.map(({ severity, code, text, line }) => [severity, code, text, line]);
      read = { name, links: links.map((link) => link.name), findings: said };
    } catch (cause) {
      if (!(cause instanceof XmlRefused)) throw cause;
      // each parser has its own words for what is no XML
      const ours = cause.message.startsWith('not XML') && expected.refused?.startsWith('not XML');
      read = { refused: ours ? expected.refused : cause.message };
    }
    expect(read).toEqual(expected);
  });

  it.each(CORPUS.meshes.map((row) => [row.file, row] as const))('a mesh: %s', async (_, row) => {
    vi.spyOn(console, 'warn').mockImplementation(() => {});
    const { file, bytes, ...expected } = row;
    const data = bytesOf(bytes);
    const loader = new MeshLoader({ fetch: async () => data });
    const read = await loader.load({ path: file, uri: file, size: data.length }).then(
      (mesh) => {
        const { triangles, notes } = factsOf(mesh, data.length);
        return { triangles, notes: notes.filter(([code]) => code !== 'gltf-axis') }; // other words; see mesh_corpus
      },
      (cause: Error) => ({ refused: cause.message.replace(`${file}: `, '') }),
    );
    expect(read).toEqual(expected);
  });

  it.each(CORPUS.names.map((row) => [row.files.find((file) => file.includes('/meshes/')), row] as const))(
    'every spelling of %s leads to it, and nothing else',
    (_, { files, urdf, found }) => {
      const file: LocalFile = { size: 1, bytes: async () => new Uint8Array(1) };
      const finder = new FileFinder(new Map(files.map((one) => [one, file])), urdf);
      const here: Record<string, unknown> = {};
      const there: Record<string, unknown> = {};
      for (const [uri, [at, why]] of Object.entries(found)) {
        const one = finder.find(uri);
        here[uri] = one.path === null ? [null, one.reason] : [one.path, one.hint];
        there[uri] = [at, why];
        // what another folder has, only the agent can tell
        if (at === null && why?.includes('--package-path')) here[uri] = [one.path, why];
      }
      expect(here).toEqual(there);
    },
  );
});
