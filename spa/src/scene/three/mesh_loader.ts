import {
  type Color,
  Loader,
  LoadingManager,
  type Material,
  type Mesh,
  type MeshStandardMaterial,
  type Object3D,
} from 'three';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js'; // loaded anyway: built models need it
import { type BundleFile, NotNow, type RawFiles } from '../../model/bundle.ts';
import type { MeshNote } from '../../model/report.ts';
import { foreignTo, MESH, type MeshKind, meshKindOf } from '../../urdf/content.ts';
import type { Paint } from '../../urdf/manifest.ts';
import type { PaintedSurface } from '../../urdf/meshes/lod_builder.ts';
import { MeshError, parseStl } from '../../urdf/meshes/stl.ts';
import { weld } from '../../urdf/meshes/weld.ts';
import { readText } from '../../urdf/text.ts';

/** A mesh read from a file. */
export interface LoadedMesh {
  /** One surface for each colour, in the file's own frame, metres. */
  readonly parts: readonly PaintedSurface[];
  /** What the reader had to work around. */
  readonly notes: readonly MeshNote[];
}

/** A white pixel that replaces textures, because bundles of version 1 have none. */
const WHITE = 'data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACwAAAAAAQABAAACAkQBADs=';

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

  async #parse(bytes: Uint8Array, file: BundleFile): Promise<LoadedMesh> {
    const kind = meshKind(bytes, file.path);
    if (kind === 'stl') {
      const { soup, notes } = parseStl(bytes);
      return { parts: [{ surface: weld(soup), paint: null }], notes };
    }
    if (kind === 'glb') return { parts: await readGlb(bytes), notes: [] };
    const { text, findings } = readText(bytes);
    const mesh =
      kind === 'collada'
        ? await readCollada(text)
        : await readObj(text, async (name) => (await this.#files.beside?.(file, name)) ?? null);
    const odd = findings.map((found): MeshNote => [found.code, found.text]);
    return { parts: mesh.parts, notes: [...odd, ...mesh.notes] };
  }

  async #read(file: BundleFile): Promise<LoadedMesh> {
    const bytes = await this.#files.fetch(file);
    try {
      const mesh = await this.#parse(bytes, file);
      if (mesh.parts.every((part) => part.surface.index.length === 0))
        throw new MeshError('it has no triangles');
      return mesh;
    } catch (cause) {
      const why = cause instanceof Error ? (cause.message.split('\n')[0] ?? '') : String(cause);
      throw new MeshError(`${file.path}: ${why}`, { cause });
    }
  }
}

/** A loading manager that fetches nothing: every file that a mesh refers to becomes a white pixel. */
function offline(): LoadingManager {
  const manager = new LoadingManager();
  manager.setURLModifier((url) => (/^(blob|data):/.test(url) ? url : WHITE));
  return manager;
}

/** Code that is loaded when a file needs it. Rejects with NotNow if it can't be loaded. */
function decoder<T>(code: Promise<T>): Promise<T> {
  return code.catch((cause: unknown) => {
    throw new NotNow('its decoder did not come', { cause });
  });
}

/** Reads an OBJ, with the colours of its MTL library if `beside` has that file. */
async function readObj(
  text: string,
  beside: (name: string) => Promise<Uint8Array | null>,
): Promise<LoadedMesh> {
  const { OBJLoader } = await decoder(import('three/addons/loaders/OBJLoader.js'));
  const loader = new OBJLoader(offline());
  const library = /^\s*mtllib\s+(\S.*?)\s*$/m.exec(text)?.[1];
  const paints = library === undefined ? null : await beside(library);
  if (paints !== null) {
    const { MTLLoader } = await decoder(import('three/addons/loaders/MTLLoader.js'));
    loader.setMaterials(new MTLLoader(offline()).parse(readText(paints).text, ''));
  }
  const lost = library !== undefined && paints === null;
  const notes: MeshNote[] = lost
    ? [['material-file', `its material library '${library.slice(0, 80)}': no such file`]]
    : [];
  return { parts: partsOf(loader.parse(text), paints !== null), notes };
}

/** Reads a self-contained GLB. Its axes are assumed to be the link's, as for any mesh. */
async function readGlb(bytes: Uint8Array): Promise<PaintedSurface[]> {
  const { GLTFLoader } = await decoder(import('three/addons/loaders/GLTFLoader.js'));
  const loader = new GLTFLoader(offline()).setMeshoptDecoder(MeshoptDecoder);
  const { scene } = await loader.parseAsync(bytes.slice().buffer, '');
  return partsOf(scene, true);
}

/** Reads Collada like RViz: `<unit>` is applied, `<up_axis>` is ignored (vertices are already in the link's frame). */
async function readCollada(text: string): Promise<LoadedMesh> {
  const { ColladaLoader } = await decoder(import('three/addons/loaders/ColladaLoader.js'));
  const scene = new ColladaLoader(offline()).parse(text, '')?.scene;
  if (scene === undefined) throw new MeshError('no Collada scene');
  scene.quaternion.identity();
  scene.position.set(0, 0, 0);
  return { parts: partsOf(scene, true), notes: colladaNotes(text) };
}

/** Notes on a Collada file's unit and up axis, and on how they are treated. */
function colladaNotes(text: string): MeshNote[] {
  const asset = /<asset[\s>].*?<\/asset>/s.exec(text.slice(0, 65_536))?.[0] ?? '';
  const metre = Number(/<unit\b[^>]*\bmeter\s*=\s*["']([^"']*)["']/.exec(asset)?.[1] ?? 1);
  const axis = (/<up_axis>([^<]*)</.exec(asset)?.[1] ?? '').trim();
  const notes: MeshNote[] = [];
  if (metre !== 1) notes.push(['collada-unit', `its unit is ${metre} m; applied`]);
  if (axis !== '' && axis !== 'Z_UP')
    notes.push(['collada-axis', `it says ${axis.slice(0, 10)}; ignored, as RViz does`]);
  return notes;
}

/** All meshes of a file in its root's frame, one part for each colour. `colored`: the file has its own materials. */
function partsOf(scene: Object3D, colored: boolean): PaintedSurface[] {
  scene.updateMatrixWorld(true);
  const groups = new Map<string, { soups: Float32Array[]; paint: Paint | null }>();
  scene.traverse((object) => {
    if (!isMesh(object)) return;
    const materials = Array.isArray(object.material) ? object.material : [object.material];
    const whole = { start: 0, count: Number.POSITIVE_INFINITY, materialIndex: 0 };
    const ranges = materials.length > 1 ? object.geometry.groups : [whole];
    for (const { start, count, materialIndex } of ranges) {
      const paint = paintOf(colored ? materials[materialIndex ?? 0] : undefined);
      const key = paint?.map((part) => part.toFixed(4)).join(' ') ?? '';
      const group = groups.get(key) ?? { soups: [], paint };
      group.soups.push(worldSoup(object, start, count));
      groups.set(key, group);
    }
  });
  return [...groups.values()].map(({ soups, paint }) => ({ surface: weld(joined(soups)), paint }));
}

function isMesh(object: Object3D): object is Mesh {
  return (object as Partial<Mesh>).isMesh === true;
}

/** The colour of a material; null when the file names none. */
function paintOf(material: Material | undefined): Paint | null {
  if (material === undefined || !isFromFile(material) || !('color' in material)) return null;
  const { r, g, b } = material.color as Color;
  // Exporters often invert transparency; an opacity of 0 is never intended.
  return [r, g, b, material.opacity <= 0 ? 1 : material.opacity];
}

/** False for the magenta or white default that three.js uses if a file names no material. */
function isFromFile(material: Material): boolean {
  const { name, type } = material;
  if (name === Loader.DEFAULT_MATERIAL_NAME) return false;
  const plain =
    type === 'MeshStandardMaterial' && (material as MeshStandardMaterial).color.getHex() === 0xffffff;
  return name !== '' || (type !== 'MeshBasicMaterial' && !plain);
}

/** The corners (x, y, z each) of a range of a mesh's triangles, in the frame of the file's root. */
function worldSoup(mesh: Mesh, start: number, count: number): Float32Array {
  const position = mesh.geometry.getAttribute('position');
  const index = mesh.geometry.getIndex();
  const end = Math.min(start + count, index?.count ?? position.count);
  const m = mesh.matrixWorld.elements;
  const soup = new Float32Array(Math.max(0, end - start) * 3);
  for (let i = start; i < end; i += 1) {
    const corner = index?.getX(i) ?? i;
    const x = position.getX(corner);
    const y = position.getY(corner);
    const z = position.getZ(corner);
    const at = (i - start) * 3;
    soup[at] = m[0]! * x + m[4]! * y + m[8]! * z + m[12]!;
    soup[at + 1] = m[1]! * x + m[5]! * y + m[9]! * z + m[13]!;
    soup[at + 2] = m[2]! * x + m[6]! * y + m[10]! * z + m[14]!;
  }
  return soup;
}

function joined(soups: readonly Float32Array[]): Float32Array {
  const all = new Float32Array(soups.reduce((sum, soup) => sum + soup.length, 0));
  let at = 0;
  for (const soup of soups) {
    all.set(soup, at);
    at += soup.length;
  }
  return all;
}
