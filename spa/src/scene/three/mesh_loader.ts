import { type BundleFile, NotNow, type RawFiles } from '../../model/bundle.ts';
import type { MeshNote } from '../../model/report.ts';
import { foreignTo, MESH, type MeshKind, meshKindOf } from '../../urdf/content.ts';
import { MeshError, parseStl } from '../../urdf/meshes/stl.ts';
import { weld } from '../../urdf/meshes/weld.ts';
import { readText } from '../../urdf/text.ts';
import type { LoadedMesh } from './loaded_mesh.ts';

/** How a format is called in a sentence. */
const NAMES: Readonly<Record<MeshKind, string>> = {
  stl: 'STL',
  collada: 'Collada',
  obj: 'OBJ',
  glb: 'glTF',
  gltf: 'glTF',
};

/** The format of a mesh file, detected from its bytes and not its name: a host may answer an unknown path with a web page, which
 *  read as STL would have four billion triangles. Throws MeshError if the format is unknown. */
export function meshKind(bytes: Uint8Array, name = ''): MeshKind {
  const foreign = foreignTo(MESH, bytes);
  if (foreign !== null) throw new MeshError(foreign);
  const kind = meshKindOf(bytes);
  if (kind === 'gltf')
    throw new MeshError('a .gltf names other files, which the page does not read: export it as GLB');
  if (kind === null && /\.stl$/i.test(name) && bytes.subarray(0, 84).includes(0)) return 'stl'; // its reader says why
  if (kind === null) throw new MeshError('not STL, Collada, OBJ or glTF');
  return kind;
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
    if (kind === 'stl') {
      const { soup, notes } = parseStl(bytes);
      return { parts: [{ surface: weld(soup), paint: null }], notes };
    }
    if (kind === 'glb') return (await decoder(import('./gltf.ts'))).readGlb(bytes);
    const { text, findings } = readText(bytes);
    const beside = async (name: string) => (await this.#files.beside?.(file, name)) ?? null;
    const mesh =
      kind === 'collada'
        ? (await decoder(import('./collada.ts'))).readCollada(text)
        : await (await decoder(import('./obj.ts'))).readObj(text, beside);
    const odd = findings.map((found): MeshNote => [found.code, found.text]);
    return { parts: mesh.parts, notes: [...odd, ...mesh.notes] };
  }

  async #read(file: BundleFile): Promise<LoadedMesh> {
    const bytes = await this.#files.fetch(file);
    let kind: MeshKind | null = null;
    try {
      kind = meshKind(bytes, file.path);
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
