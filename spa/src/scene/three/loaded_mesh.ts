import { type Color, Loader, LoadingManager, type Material, type Mesh, type Object3D } from 'three';
import type { MeshNote } from '../../model/report.ts';
import type { Paint } from '../../urdf/manifest.ts';
import type { PaintedSurface } from '../../urdf/meshes/lod_builder.ts';
import { MeshError } from '../../urdf/meshes/stl.ts';
import { weld } from '../../urdf/meshes/weld.ts';

/** A mesh read from a file. */
export interface LoadedMesh {
  /** One surface for each colour, in the file's own frame, metres. */
  readonly parts: readonly PaintedSurface[];
  /** What the reader had to work around. */
  readonly notes: readonly MeshNote[];
}

/** Said of a file with pictures: raw meshes are drawn without. */
export const NO_PICTURES: MeshNote = [
  'texture',
  'its pictures are not drawn here; `posecast-edge model build` shows them',
];

/** A white pixel that replaces textures, because bundles of version 1 have none. */
const WHITE = 'data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACwAAAAAAQABAAACAkQBADs=';

/** A loading manager that fetches nothing: every file that a mesh refers to becomes a white pixel. */
export function offline(): LoadingManager {
  const manager = new LoadingManager();
  manager.setURLModifier((url) => (/^(blob|data):/.test(url) ? url : WHITE));
  return manager;
}

/** All meshes of a file in its root's frame, one part for each colour. `colored`: the file has its own materials. */
export function partsOf(scene: Object3D, colored: boolean): PaintedSurface[] {
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
  const plain = ['MeshStandardMaterial', 'MeshPhongMaterial'].includes(type);
  const white = 'color' in material && (material.color as Color).getHex() === 0xffffff;
  return name !== '' || (type !== 'MeshBasicMaterial' && !(plain && white));
}

/** The corners (x, y, z each) of a range of a mesh's triangles, in the frame of the file's root. Those of a mirrored mesh are
 *  reversed, so that they face outwards. */
function worldSoup(mesh: Mesh, start: number, count: number): Float32Array {
  const position = mesh.geometry.getAttribute('position');
  const index = mesh.geometry.getIndex();
  const end = Math.min(start + count, index?.count ?? position.count);
  const m = mesh.matrixWorld.elements;
  const mirrored = mesh.matrixWorld.determinant() < 0;
  const soup = new Float32Array(Math.max(0, end - start) * 3);
  for (let i = start; i < end; i += 1) {
    const corner = index?.getX(i) ?? i;
    const x = position.getX(corner);
    const y = position.getY(corner);
    const z = position.getZ(corner);
    if (!(corner < position.count)) throw new MeshError('a triangle refers to a vertex that does not exist');
    if (!Number.isFinite(x + y + z)) throw new MeshError('vertices that are not finite (NaN)');
    const number = i - start;
    const at = 3 * (mirrored && number % 3 > 0 ? number + 3 - 2 * (number % 3) : number);
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
