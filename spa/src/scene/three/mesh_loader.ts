import { type BundleFile, NotNow, type RawFiles } from '../../model/bundle.ts';
import type { MeshNote } from '../../model/report.ts';
import { isAsciiStl, isBinaryStl, MeshError, parseStl, tailBytes } from '../../urdf/meshes/stl.ts';
import { weld } from '../../urdf/meshes/weld.ts';
import type { LoadedMesh } from './loaded_mesh.ts';

export type MeshKind = 'stl' | 'collada' | 'obj' | 'glb';

/** How a format is called in a sentence. */
const NAMES: Readonly<Record<MeshKind, string>> = { stl: 'STL', collada: 'Collada', obj: 'OBJ', glb: 'glTF' };

/** The format of a mesh file, detected from its bytes and not its name: a host may answer an unknown path with a web page, which
 *  read as STL would have four billion triangles. Throws MeshError if the format is unknown. */
export function meshKind(bytes: Uint8Array): MeshKind {
  if (new TextDecoder('latin1').decode(bytes.subarray(0, 4)) === 'glTF') return 'glb';
  if (isBinaryStl(bytes)) return 'stl';
  const head = new TextDecoder('latin1').decode(bytes.subarray(0, 4096));
  if (/<COLLADA[\s>]/.test(head)) return 'collada';
  if (/<!doctype html|<html[\s>]/i.test(head))
    throw new MeshError('the server sent a web page instead of a mesh');
  if (isAsciiStl(bytes)) return 'stl';
  if (bytes.length === 0) throw new MeshError('empty');
  if (/^\s*(?:v|mtllib|o|g)\s+\S/m.test(head) && !head.includes('\0')) return 'obj';
  throw new MeshError('not STL, Collada, OBJ or GLB');
}

/** Loads the mesh files of one bundle, each once even if several links use it. */
export class MeshLoader {
  readonly #files: RawFiles;
  readonly #meshes = new Map<string, Promise<LoadedMesh>>();

  constructor(files: RawFiles) {
    this.#files = files;
  }

  /** Fetches and reads a mesh. Rejects with a one-line Error that names the file. */
  load(file: BundleFile): Promise<LoadedMesh> {
    let mesh = this.#meshes.get(file.path);
    if (mesh === undefined) {
      mesh = this.#read(file);
      this.#meshes.set(file.path, mesh);
    }
    return mesh;
  }

  async #parse(kind: MeshKind, bytes: Uint8Array, file: BundleFile): Promise<LoadedMesh> {
    switch (kind) {
      case 'stl':
        return {
          parts: [{ surface: weld(parseStl(bytes)), paint: null }],
          notes: stlNotes(bytes),
        };
      case 'collada':
        return (await decoder(import('./collada.ts'))).readCollada(new TextDecoder().decode(bytes));
      case 'obj':
        return (await decoder(import('./obj.ts'))).readObj(
          new TextDecoder().decode(bytes),
          async (name) => (await this.#files.beside?.(file, name)) ?? null,
        );
      case 'glb':
        return (await decoder(import('./gltf.ts'))).readGlb(bytes);
    }
  }

  async #read(file: BundleFile): Promise<LoadedMesh> {
    const bytes = await this.#files.fetch(file);
    let kind: MeshKind | null = null;
    try {
      kind = meshKind(bytes);
      const mesh = await this.#parse(kind, bytes, file);
      if (mesh.parts.every((part) => part.surface.index.length === 0))
        throw new MeshError('it has no triangles');
      return mesh;
    } catch (cause) {
      // What a loader of three.js throws on is no sentence for people.
      const own = cause instanceof MeshError || cause instanceof NotNow;
      const why = own
        ? cause.message
        : `its ${kind === null ? 'file' : NAMES[kind]} is broken; export it again`;
      throw new MeshError(`${file.path}: ${why}`, { cause });
    }
  }
}

/** Code that is loaded when a file needs it. Rejects with NotNow if it can't be loaded. */
function decoder<T>(code: Promise<T>): Promise<T> {
  return code.catch((cause: unknown) => {
    throw new NotNow('its decoder did not come', { cause });
  });
}

function stlNotes(bytes: Uint8Array): MeshNote[] {
  const tail = tailBytes(bytes);
  return tail === 0 ? [] : [['stl-tail', `${tail} bytes after the last triangle`]];
}
