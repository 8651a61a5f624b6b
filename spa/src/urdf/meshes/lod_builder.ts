import { emptyBox, growBox, type LinkBox } from '../../model/bounds.ts';
import { MAX_UNPACKED_BYTES } from '../../model/glb.ts';
import { transform } from '../../model/kinematics.ts';
import { assembleLod, bytesOf, type Lod, type Primitive } from '../../model/lod.ts';
import { pointThrough } from '../../model/vectors.ts';
import type { Paint, PlacedShape } from '../manifest.ts';
import type { Vector } from '../types.ts';
import { MeshError } from './stl.ts';
import type { Welded } from './weld.ts';

/** A surface of one colour, in its mesh's axes. `paint` is null if its file specifies none. */
export interface PaintedSurface {
  readonly surface: Welded;
  readonly paint: Paint | null;
}

/** The default colour if neither URDF nor mesh specifies one: #c4cad3 in linear light. */
const UNPAINTED: Paint = [0.5520114, 0.5906189, 0.651406, 1];
/** Maximum number of paints: they are one row of a texture, and every GPU allows this width. Further ones get the default
 *  colour. */
const MAX_PAINTS = 2048;
/** The largest 16-bit coordinate to which positions are rounded. */
const REACH = 32_767;

/** A mesh at one scale: its primitives without paint, rounded to their own grid. */
interface Body {
  readonly centre: Vector;
  /** Metres per unit of the grid. */
  readonly step: number;
  readonly pieces: readonly Omit<Primitive, 'paint'>[];
}

/** Builds one level of detail from a robot's meshes, which may come in any order. */
export class LodBuilder {
  readonly #shapes: readonly PlacedShape[];
  readonly #shown: (readonly Primitive[])[];
  readonly #linkFromMesh: Float64Array;
  /** By mesh, then by scale. */
  readonly #bodies = new Map<readonly PaintedSurface[], Map<string, Body>>();
  readonly #positions: Int16Array[] = [];
  readonly #normals: Int8Array[] = [];
  readonly #paints: Paint[] = [UNPAINTED];
  readonly #paintOf = new Map([[keyOf(UNPAINTED), 0]]);
  #vertices = 0;
  #triangles = 0;
  #room = MAX_UNPACKED_BYTES; // many visuals may show one mesh

  constructor(shapes: readonly PlacedShape[]) {
    this.#shapes = shapes;
    this.#shown = shapes.map(() => []);
    this.#linkFromMesh = Float64Array.from(shapes.flatMap(({ xyz, quat }) => transform(xyz, quat)));
  }

  /** Triangles drawn: a mesh that two visuals show counts twice. */
  get triangles(): number {
    return this.#triangles;
  }

  /** Assigns a mesh to a visual. Returns the box in the link's frame, metres. Throws MeshError if there is no room for it. */
  put(visual: number, mesh: readonly PaintedSurface[]): LinkBox {
    const { shape, xyz, quat, paint: own } = this.#shapes[visual]!;
    const cost = mesh.reduce((sum, { surface: { positions, index } }) => {
      return sum + bytesOf({ count: positions.length / 3, index });
    }, 0);
    if (cost > this.#room) throw new MeshError('left out: the robot already unpacks to too many bytes');
    const { centre, step, pieces } = this.#body(mesh, shape.scale);
    this.#room -= cost;
    const linkFromVisual = transform(xyz, quat);
    this.#shown[visual] = pieces.map((piece, i) => ({
      ...piece,
      paint: this.#paint(mesh[i]!.paint ?? own ?? UNPAINTED),
    }));
    this.#triangles += pieces.reduce((sum, { index }) => sum + index.length / 3, 0);
    this.#linkFromMesh.set(transform(pointThrough(linkFromVisual, centre), quat, step), visual * 16);
    const linkFromSurface = linkFromVisual.map((part, i) => part * (shape.scale[Math.floor(i / 4)] ?? 1));
    const box = emptyBox();
    for (const { surface } of mesh) growBox(box, surface.positions, linkFromSurface);
    return box;
  }

  /** Builds the level from all meshes so far. */
  build(): Lod {
    const vertices = {
      positions: joined(this.#positions, new Int16Array(this.#vertices * 4)),
      normals: joined(this.#normals, new Int8Array(this.#vertices * 4)),
      uvs: null,
    };
    const paints = Float32Array.from(this.#paints.flat());
    const source = { ...vertices, paints, pictures: [], pictureOf: () => null };
    return assembleLod(source, this.#shown, this.#linkFromMesh.slice());
  }

  #paint(paint: Paint): number {
    const key = keyOf(paint);
    let number = this.#paintOf.get(key);
    if (number === undefined) {
      if (this.#paints.length >= MAX_PAINTS) return 0;
      number = this.#paints.push(paint) - 1;
      this.#paintOf.set(key, number);
    }
    return number;
  }

  #body(mesh: readonly PaintedSurface[], scale: Vector): Body {
    const scaled = this.#bodies.get(mesh) ?? new Map<string, Body>();
    this.#bodies.set(mesh, scaled);
    const key = scale.join(' ');
    const body = scaled.get(key) ?? this.#rounded(mesh, scale);
    scaled.set(key, body);
    return body;
  }

  /** Rounds a mesh to a grid of 16 bits along its longest side. The scale is applied here, because bones are rigid. */
  #rounded(mesh: readonly PaintedSurface[], scale: Vector): Body {
    const box = emptyBox();
    const stretch = [scale[0], 0, 0, 0, 0, scale[1], 0, 0, 0, 0, scale[2], 0, 0, 0, 0, 1];
    for (const { surface } of mesh) growBox(box, surface.positions, stretch);
    if (![...box.min, ...box.max].every(Number.isFinite)) throw new MeshError('too large to draw');
    const centre = box.min.map((low, i) => (low + box.max[i]!) / 2) as unknown as Vector;
    const step = Math.max(...box.max.map((high, i) => (high - box.min[i]!) / 2), 1e-9) / REACH;
    return { centre, step, pieces: mesh.map(({ surface }) => this.#add(surface, scale, centre, step)) };
  }

  #add(surface: Welded, scale: Vector, centre: Vector, step: number): Omit<Primitive, 'paint'> {
    const first = this.#vertices;
    const count = surface.positions.length / 3;
    const positions = new Int16Array(count * 4);
    const normals = new Int8Array(count * 4);
    for (let i = 0; i < count; i += 1) {
      const x = surface.normals[i * 3]! / scale[0];
      const y = surface.normals[i * 3 + 1]! / scale[1];
      const z = surface.normals[i * 3 + 2]! / scale[2];
      const length = 127 / Math.hypot(x, y, z);
      normals[i * 4] = Math.round(x * length);
      normals[i * 4 + 1] = Math.round(y * length);
      normals[i * 4 + 2] = Math.round(z * length);
      for (let axis = 0; axis < 3; axis += 1) {
        const metres = surface.positions[i * 3 + axis]! * scale[axis]!;
        positions[i * 4 + axis] = Math.round((metres - centre[axis]!) / step);
      }
    }
    const index = surface.index.map((vertex) => first + vertex);
    if (scale[0] * scale[1] * scale[2] < 0) turnOver(index);
    this.#positions.push(positions);
    this.#normals.push(normals);
    this.#vertices += count;
    return { first, count, index };
  }
}

const keyOf = (paint: Paint) => paint.map((part) => part.toFixed(4)).join(' ');

/** Reverses the triangles of a mirrored mesh, so that they face outwards again. */
function turnOver(index: Uint32Array): void {
  for (let at = 0; at < index.length; at += 3) {
    [index[at + 1], index[at + 2]] = [index[at + 2]!, index[at + 1]!];
  }
}

function joined<T extends Int16Array | Int8Array>(parts: readonly T[], all: T): T {
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}
