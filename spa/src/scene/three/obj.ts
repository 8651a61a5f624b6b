import type { MeshNote } from '../../model/report.ts';
import { quoted } from '../../urdf/finding.ts';
import { linear, type Paint } from '../../urdf/manifest.ts';
import type { PaintedSurface } from '../../urdf/meshes/lod_builder.ts';
import { MeshError } from '../../urdf/meshes/stl.ts';
import { weld } from '../../urdf/meshes/weld.ts';
import { readText } from '../../urdf/text.ts';
import { type LoadedMesh, NO_PICTURES } from './loaded_mesh.ts';
import { PolygonCutter } from './polygons.ts';

/** Reads Wavefront OBJ with its material libraries, like the edge (posecast_edge.model.meshes.obj), but without pictures. */

const NO_VERTEX = 'a triangle refers to a vertex that does not exist';
const BAD_VERTEX = 'a vertex of the OBJ is not a list of numbers';
const MAX_TRIANGLES = 5_000_000;
const MAX_MATERIALS = 10_000;
/** Between the names of a `mtllib` line, which may have spaces. */
const BETWEEN_LIBRARIES = /(?<=\.mtl)\s+/i;
/** Kd of a material without one. */
const DEFAULT = 0.8;
const INTEGER = /^[+-]?\d+$/;

interface Look {
  readonly kd: readonly number[];
  readonly opacity: number;
  readonly pictured: boolean;
}

/** Reads an OBJ. `beside` reads a file beside it, null if there is none. Rejects with MeshError. */
export async function readObj(
  text: string,
  beside: (name: string) => Promise<Uint8Array | null>,
): Promise<LoadedMesh> {
  const notes: MeshNote[] = [];
  const vertices: number[] = [];
  const libraries = new Set<string>();
  const faces = new Map<string, number[][]>(); // vertices of each polygon, by material
  let group: number[][] = [];
  let triangles = 0;
  faces.set('', group);
  for (const line of text.replace(/\\\r?\n/g, ' ').split(/\r\n?|\n/)) {
    const [, word, rest = ''] = /^\s*(\S+)(?:\s+(.*?))?\s*$/.exec(line) ?? [];
    if (word === 'v') vertices.push(...vertexOf(rest));
    else if (word === 'f') {
      const corners = rest.split(/\s+/).map((corner) => numberOf(corner, vertices.length / 3));
      if (corners.length < 3) continue;
      group.push(corners);
      triangles += corners.length - 2;
      if (triangles > MAX_TRIANGLES) throw new MeshError('more than 5,000,000 triangles');
    } else if (word === 'usemtl') {
      group = faces.get(rest) ?? [];
      faces.set(rest, group);
      if (faces.size > MAX_MATERIALS) throw new MeshError('more than 10,000 materials');
    } else if (word === 'mtllib') {
      for (const name of rest.split(BETWEEN_LIBRARIES)) libraries.add(name);
    }
  }
  const looks = new Map<string, Look>();
  for (const name of libraries) {
    const bytes = await beside(name);
    if (bytes !== null) readLibrary(readText(bytes).text, looks);
    else notes.push(['material-file', `its material library ${quoted(name)}: no such file`]);
  }
  const cutter = new PolygonCutter(notes);
  const soups = new Map<string, { paint: Paint | null; corners: number[][] }>(); // by paint
  for (const [name, polygons] of faces) {
    const paint = paintOf(looks.get(name));
    const soup = soups.get(String(paint)) ?? { paint, corners: [] };
    for (const polygon of polygons) soup.corners.push(triangulated(polygon, vertices, cutter));
    soups.set(String(paint), soup);
  }
  const parts: PaintedSurface[] = [...soups.values()]
    .filter(({ corners }) => corners.length > 0)
    .map(({ paint, corners }) => ({ surface: weld(Float32Array.from(corners.flat())), paint }));
  if ([...looks.values()].some(({ pictured }) => pictured)) notes.push(NO_PICTURES);
  return { parts, notes };
}

function vertexOf(rest: string): number[] {
  const words = rest.split(/\s+/, 3);
  const numbers = words.map(Number);
  if (words.length < 3 || words.includes('')) throw new MeshError(BAD_VERTEX);
  if (numbers.every(Number.isFinite)) return numbers;
  const known = words.every(
    (word, i) => Number.isFinite(numbers[i]) || /^[+-]?(nan|inf(inity)?)$/i.test(word),
  );
  throw new MeshError(known ? 'vertices that are not finite (NaN)' : BAD_VERTEX);
}

/** The number of a corner's vertex, from 0. */
function numberOf(corner: string, vertices: number): number {
  const [vertex = '', texture = ''] = corner.split('/');
  if (!INTEGER.test(vertex) || (texture !== '' && !INTEGER.test(texture)))
    throw new MeshError('a face of the OBJ is not a list of numbers');
  const number = Number(vertex);
  return number > 0 ? number - 1 : vertices + number;
}

/** The corners (x, y, z each) of a polygon's triangles. */
function triangulated(
  corners: readonly number[],
  vertices: readonly number[],
  cutter: PolygonCutter,
): number[] {
  const points = corners.map((vertex): [number, number, number] => {
    const at = 3 * vertex;
    if (vertex < 0 || at >= vertices.length) throw new MeshError(NO_VERTEX);
    return [vertices[at]!, vertices[at + 1]!, vertices[at + 2]!];
  });
  return cutter.cut(points).flatMap((corner) => points[corner]!);
}

function readLibrary(text: string, looks: Map<string, Look>): void {
  let current = '';
  const own = new Map<string, Look>();
  for (const line of text.split(/\r\n?|\n/)) {
    const [, key = '', rest = ''] = /^\s*(\S+)\s*(.*?)\s*$/.exec(line) ?? [];
    if (key.toLowerCase() === 'newmtl') {
      current = rest;
      own.set(current, { kd: [DEFAULT, DEFAULT, DEFAULT], opacity: 1, pictured: false });
    } else if (rest !== '' && own.has(current)) {
      own.set(current, changed(own.get(current)!, key.toLowerCase(), rest.split(/\s+/)));
    }
  }
  for (const [name, look] of own) looks.set(name, look);
}

function changed(look: Look, key: string, words: readonly string[]): Look {
  const numbers = words.map(Number);
  if (key === 'kd' && numbers.length >= 3 && numbers.slice(0, 3).every(Number.isFinite))
    return { ...look, kd: numbers.slice(0, 3).map((value) => Math.min(Math.max(value, 0), 1)) };
  if (key === 'd' || key === 'tr') {
    const opacity = key === 'd' ? numbers.at(-1)! : 1 - numbers[0]!;
    return Number.isNaN(opacity) ? look : { ...look, opacity: opacity > 0.02 && opacity < 1 ? opacity : 1 };
  }
  return key === 'map_kd' ? { ...look, pictured: true } : look;
}

/** The paint of a material, linear; null if no library has it. With a picture, exporters leave Kd black or at its default. */
function paintOf(look: Look | undefined): Paint | null {
  if (look === undefined) return null;
  const { kd, opacity, pictured } = look;
  const unset = pictured && (Math.max(...kd) < 0.02 || kd.every((value) => value === DEFAULT));
  const [r, g, b] = (unset ? [1, 1, 1] : kd).map(linear);
  return [r!, g!, b!, opacity];
}
