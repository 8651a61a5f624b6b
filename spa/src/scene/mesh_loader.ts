import { type Color, Loader, LoadingManager, type Material, type Mesh, type Object3D } from 'three';
import type { BundleFile } from './bundle.ts';
import type { RawFiles } from './raw_robot.ts';
import { isAsciiStl, isBinaryStl, MeshError, parseStl } from './stl.ts';
import { type Welded, weld } from './weld.ts';

/** One colour of a mesh file, in the file's own frame and in metres. `color` is null where the file names none. */
export interface MeshPart {
  surface: Welded;
  color: Color | null;
  opacity: number;
}

export type MeshKind = 'stl' | 'collada';

/** A white pixel: what a Collada texture becomes, as bundles of this version carry none. */
const WHITE = 'data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACwAAAAAAQABAAACAkQBADs=';

/** What the bytes are, whatever the file is called. A host that answers an unknown path with its start page would
 *  otherwise be read as four billion triangles. Throws MeshError. */
export function meshKind(bytes: Uint8Array): MeshKind {
  if (isBinaryStl(bytes)) return 'stl';
  const head = new TextDecoder('latin1').decode(bytes.subarray(0, 4096));
  if (/<COLLADA[\s>]/.test(head)) return 'collada';
  if (/<!doctype html|<html[\s>]/i.test(head)) throw new MeshError('a web page came instead of a mesh');
  if (isAsciiStl(bytes)) return 'stl';
  if (bytes.length === 0) throw new MeshError('empty');
  throw new MeshError('neither STL nor Collada');
}

/** Mesh files of one bundle, each fetched and read once however many links use it. */
export class MeshLoader {
  readonly #files: RawFiles;
  readonly #parts = new Map<string, Promise<MeshPart[]>>();

  constructor(files: RawFiles) {
    this.#files = files;
  }

  /** Rejects with a one-line Error that names the file. */
  load(file: BundleFile): Promise<MeshPart[]> {
    let parts = this.#parts.get(file.path);
    if (parts === undefined) {
      parts = this.#read(file);
      this.#parts.set(file.path, parts);
    }
    return parts;
  }

  async #read(file: BundleFile): Promise<MeshPart[]> {
    const bytes = await this.#files.fetch(file);
    try {
      const parts =
        meshKind(bytes) === 'stl'
          ? [{ surface: weld(parseStl(bytes)), color: null, opacity: 1 }]
          : await readCollada(new TextDecoder().decode(bytes));
      if (parts.every((part) => part.surface.index.length === 0)) throw new MeshError('no triangles');
      return parts;
    } catch (cause) {
      const why = cause instanceof Error ? (cause.message.split('\n')[0] ?? '') : String(cause);
      throw new MeshError(`${file.path}: ${why}`, { cause });
    }
  }
}

/** Collada as RViz reads it: `<unit>` applied, `<up_axis>` ignored (its vertices are in the link's frame already). */
async function readCollada(text: string): Promise<MeshPart[]> {
  const { ColladaLoader } = await import('three/addons/loaders/ColladaLoader.js');
  const manager = new LoadingManager();
  manager.setURLModifier(() => WHITE);
  const scene = new ColladaLoader(manager).parse(text, '')?.scene;
  if (scene === undefined) throw new MeshError('no Collada scene');
  scene.quaternion.identity();
  scene.position.set(0, 0, 0);
  scene.updateMatrixWorld(true);

  const groups = new Map<string, { soups: Float32Array[]; color: Color | null; opacity: number }>();
  scene.traverse((object) => {
    if (!isMesh(object)) return;
    const materials = Array.isArray(object.material) ? object.material : [object.material];
    const whole = { start: 0, count: Number.POSITIVE_INFINITY, materialIndex: 0 };
    const ranges = materials.length > 1 ? object.geometry.groups : [whole];
    for (const { start, count, materialIndex } of ranges) {
      const { color, opacity } = paint(materials[materialIndex ?? 0]);
      const key = color === null ? '' : `${color.getHexString()} ${opacity}`;
      const group = groups.get(key) ?? { soups: [], color, opacity };
      group.soups.push(worldSoup(object, start, count));
      groups.set(key, group);
    }
  });
  return [...groups.values()].map(({ soups, color, opacity }) => ({
    surface: weld(joined(soups)),
    color,
    opacity,
  }));
}

function isMesh(object: Object3D): object is Mesh {
  return (object as Partial<Mesh>).isMesh === true;
}

function paint(material: Material | undefined): { color: Color | null; opacity: number } {
  const color =
    material !== undefined && isFromFile(material) && 'color' in material ? (material.color as Color) : null;
  // Exporters often write transparency the wrong way round; a body of opacity 0 is never meant.
  const opacity = color === null || material === undefined || material.opacity <= 0 ? 1 : material.opacity;
  return { color, opacity };
}

/** False for what three.js puts where a file names no material: a magenta or a white stand-in. */
function isFromFile({ name, type }: Material): boolean {
  return name !== Loader.DEFAULT_MATERIAL_NAME && !(name === '' && type === 'MeshBasicMaterial');
}

/** Corners of a range of a mesh's triangles, in the frame of the file's root. */
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
