import { BundleError, isRecord } from './bundle.ts';
import { lodBytes } from './files.ts';
import { type Accessor, Glb, GlbError, isSize, MAX_UNPACKED_BYTES } from './glb.ts';
import { transform } from './kinematics.ts';
import type { LodFile } from './manifest.ts';

/**
 * One level of detail, ready for a few draw calls: all visuals in one set of arrays, each vertex with the index of its "bone"
 * (its visual) and of its "paint" (its material). Independent of three.js.
 */
export interface Lod {
  /** x, y, z, 0 of each vertex, in the units of its visual's mesh. */
  readonly positions: Int16Array;
  /** x, y, z, 0 of each vertex's normal, 127 = 1. */
  readonly normals: Int8Array;
  /** Bone and paint of each vertex. */
  readonly parts: Uint16Array;
  /** u, v of each vertex; null when nothing is textured. */
  readonly uvs: Float32Array | null;
  readonly index: Uint32Array;
  /** The draw calls: first everything untextured, then one for each texture. */
  readonly draws: readonly Draw[];
  /** link_from_mesh of each visual: 16 numbers, column-major, from mesh units to metres. */
  readonly linkFromMesh: Float64Array;
  /** Lower and upper corner of each visual in mesh units, 6 numbers; upper < lower if the visual is empty. */
  readonly boxes: Int16Array;
  /** For each visual, the ranges of `index` that show it: start, count, start, count, … */
  readonly ranges: readonly (readonly number[])[];
  /** Red, green, blue (linear) and opacity of each paint. Opacity `STAND_IN` marks the placeholder of a missing mesh.
   *  */
  readonly paints: Float32Array;
  readonly pictures: readonly Blob[];
}

/** One draw call: a range of `Lod.index`. */
export interface Draw {
  readonly start: number;
  readonly count: number;
  /** Index in `pictures`. */
  readonly picture: number | null;
}

/** Opacity that marks the placeholder of a missing mesh. */
export const STAND_IN = 2;

type Raw = Readonly<Record<string, unknown>>;

/** Triangles of one paint. `index` names vertices of the source, all among the `count` from `first` on. */
export interface Primitive {
  readonly first: number;
  readonly count: number;
  readonly index: Uint32Array;
  readonly paint: number;
}

/** The vertex arrays that all primitives of a level share, laid out as in `Lod`, with their paints and pictures. */
export interface LodSource extends Pick<Lod, 'positions' | 'normals' | 'uvs' | 'paints' | 'pictures'> {
  /** Index in `pictures` of a paint's texture; null for a plain paint. */
  pictureOf(paint: number): number | null;
}

/** How many bytes a level grows by when one more visual shows a primitive. */
export function bytesOf({ count, index }: Pick<Primitive, 'count' | 'index'>): number {
  return PRIMITIVE_BYTES + count * VERTEX_BYTES + index.byteLength;
}

/** Bytes of each vertex: position, normal, bone and paint, u and v. */
const VERTEX_BYTES = 24;
const PRIMITIVE_BYTES = 100;
/** The maximum number of textures; a robot has some dozens, and each needs a draw call. */
const MAX_PICTURES = 256;
const BYTE = 5120;
const SHORT = 5122;
const UNSIGNED_INT = 5125;
const FLOAT = 5126;

/** Reads a level's GLB (docs/reference/model-bundle.md). Rejects with GlbError if it is invalid or does not have exactly
 *  `visuals` nodes. */
export async function readLod(bytes: Uint8Array, visuals: number): Promise<Lod> {
  const glb = await Glb.read(bytes);
  const nodes = glb.list('nodes');
  if (nodes.length !== visuals) throw new GlbError(`${nodes.length} nodes for ${visuals} visuals`);
  const source = new GlbLodSource(glb);
  let room = MAX_UNPACKED_BYTES; // many nodes may show one mesh, so the file size is no upper bound
  const shown = nodes.map(({ mesh }) => {
    const parts = mesh === undefined ? [] : source.primitives(mesh);
    for (const part of parts) room -= bytesOf(part);
    if (room < 0) throw new GlbError('unpacks to too many bytes');
    return parts;
  });
  return assembleLod(source, shown, Float64Array.from(nodes.flatMap(nodeTransform)));
}

/** Builds a level from the primitives that each visual shows. A primitive that several visuals show is copied for each, since
 *  each has its own bone. Throws GlbError if a triangle uses a vertex outside its primitive. */
export function assembleLod(
  source: LodSource,
  shown: readonly (readonly Primitive[])[],
  linkFromMesh: Float64Array,
): Lod {
  const all = shown.flat();
  const vertices = all.reduce((sum, part) => sum + part.count, 0);
  const corners = all.reduce((sum, part) => sum + part.index.length, 0);

  const level = {
    positions: new Int16Array(vertices * 4),
    normals: new Int8Array(vertices * 4),
    parts: new Uint16Array(vertices * 2),
    uvs: source.uvs === null ? null : new Float32Array(vertices * 2),
    index: new Uint32Array(corners),
    draws: [] as Draw[],
    linkFromMesh,
    boxes: new Int16Array(shown.length * 6),
    ranges: shown.map((): number[] => []),
    paints: source.paints,
    pictures: source.pictures,
  };
  const placed = new Map<number | null, { bone: number; part: Primitive; base: number }[]>();
  for (const picture of [null, ...source.pictures.keys()]) placed.set(picture, []);
  let base = 0;
  for (const [bone, parts] of shown.entries()) {
    level.boxes.set([32767, 32767, 32767, -32768, -32768, -32768], bone * 6);
    for (const part of parts) {
      const end = part.first + part.count;
      level.positions.set(source.positions.subarray(part.first * 4, end * 4), base * 4);
      level.normals.set(source.normals.subarray(part.first * 4, end * 4), base * 4);
      if (source.uvs !== null) level.uvs?.set(source.uvs.subarray(part.first * 2, end * 2), base * 2);
      for (let i = base; i < base + part.count; i += 1) {
        level.parts[i * 2] = bone;
        level.parts[i * 2 + 1] = part.paint;
        for (let axis = 0; axis < 3; axis += 1) {
          const at = level.positions[i * 4 + axis]!;
          if (at < level.boxes[bone * 6 + axis]!) level.boxes[bone * 6 + axis] = at;
          if (at > level.boxes[bone * 6 + 3 + axis]!) level.boxes[bone * 6 + 3 + axis] = at;
        }
      }
      placed.get(source.pictureOf(part.paint))!.push({ bone, part, base });
      base += part.count;
    }
  }
  let at = 0;
  for (const [picture, parts] of placed) {
    const start = at;
    for (const { bone, part, base: first } of parts) {
      const shift = first - part.first;
      for (let i = 0; i < part.index.length; i += 1) {
        const vertex = part.index[i]! - part.first;
        if (!(vertex >= 0 && vertex < part.count)) throw new GlbError('a triangle reaches outside its mesh');
        level.index[at + i] = part.index[i]! + shift;
      }
      level.ranges[bone]!.push(at, part.index.length);
      at += part.index.length;
    }
    if (at > start) level.draws.push({ start, count: at - start, picture });
  }
  return level;
}

/** A `LodSource` that is read from a GLB. */
class GlbLodSource implements LodSource {
  readonly paints: Float32Array;
  readonly pictures: readonly Blob[];
  positions = new Int16Array();
  normals = new Int8Array();
  uvs: Float32Array | null = null;
  readonly #glb: Glb;
  readonly #pictureOf: readonly (number | null)[];
  readonly #meshes = new Map<unknown, readonly Primitive[]>();
  readonly #indices = new Map<number, Uint32Array>();
  #shared: string | null = null;
  #laid: unknown = null;

  constructor(glb: Glb) {
    this.#glb = glb;
    const images = glb.list('images');
    if (images.length > MAX_PICTURES) throw new GlbError(`more than ${MAX_PICTURES} pictures`);
    let room = MAX_UNPACKED_BYTES; // many primitives may share one view
    this.pictures = images.map(({ bufferView, mimeType }) => {
      if (mimeType !== 'image/png' && mimeType !== 'image/jpeg')
        throw new GlbError('a picture of unknown type');
      const bytes = glb.view(bufferView);
      room -= bytes.length;
      if (room < 0) throw new GlbError('unpacks to too many bytes');
      return new Blob([bytes.slice()], { type: mimeType });
    });
    const textures = glb.list('textures');
    // One extra for primitives without a material.
    const paints = [...glb.list('materials'), {}].map((material: Raw) => {
      const pbr = isRecord(material.pbrMetallicRoughness) ? material.pbrMetallicRoughness : {};
      const factor = Array.isArray(pbr.baseColorFactor) ? pbr.baseColorFactor.map(Number) : [1, 1, 1, 1];
      const color = factor.length === 4 && factor.every(Number.isFinite) ? factor : [1, 1, 1, 1];
      const standIn = isRecord(material.extras) && material.extras.placeholder === true;
      if (standIn) color[3] = STAND_IN;
      else if (material.alphaMode !== 'BLEND') color[3] = 1;
      const index = isRecord(pbr.baseColorTexture) ? pbr.baseColorTexture.index : undefined;
      const picture = isSize(index) ? textures[index]?.source : undefined;
      return { color, picture: isSize(picture) && picture < this.pictures.length ? picture : null };
    });
    this.paints = Float32Array.from(paints.flatMap(({ color }) => color));
    this.#pictureOf = paints.map(({ picture }) => picture);
  }

  pictureOf(paint: number): number | null {
    return this.#pictureOf[paint] ?? null;
  }

  primitives(mesh: unknown): readonly Primitive[] {
    let found = this.#meshes.get(mesh);
    if (found === undefined) {
      const raw = isSize(mesh) ? this.#glb.list('meshes')[mesh] : undefined;
      if (!Array.isArray(raw?.primitives)) throw new GlbError(`no mesh ${String(mesh)}`);
      found = raw.primitives.map((primitive: unknown) => this.#primitive(primitive));
      this.#meshes.set(mesh, found);
    }
    return found;
  }

  #primitive(raw: unknown): Primitive {
    if (!isRecord(raw) || !isRecord(raw.attributes) || !isRecord(raw.extras))
      throw new GlbError('not a primitive');
    this.#share(raw.attributes);
    const { first, count } = raw.extras;
    if (!isSize(first) || !isSize(count) || (first + count) * 4 > this.positions.length) {
      throw new GlbError('a mesh reaches past the last vertex');
    }
    const accessor = this.#glb.accessor(raw.indices);
    if (accessor.componentType !== UNSIGNED_INT || accessor.count % 3 !== 0)
      throw new GlbError('no triangles');
    const index = this.#index(raw.indices as number, accessor);
    const last = this.#pictureOf.length - 1;
    const paint = isSize(raw.material) && raw.material < last ? raw.material : last;
    return { first, count, index, paint };
  }

  /** The indices of an accessor, read once even if several primitives name it. */
  #index(at: number, accessor: Accessor): Uint32Array {
    const index = this.#indices.get(at) ?? numbers(this.#glb, accessor, Uint32Array, 1);
    this.#indices.set(at, index);
    return index;
  }

  /** Reads the shared vertex arrays. All primitives must refer to the same ones; textured primitives also have u and v. */
  #share({ POSITION, NORMAL, TEXCOORD_0 }: Raw): void {
    if (TEXCOORD_0 !== undefined) this.#lay(TEXCOORD_0, this.#glb.accessor(POSITION).count);
    const named = `${POSITION} ${NORMAL}`;
    if (this.#shared === named) return;
    if (this.#shared !== null) throw new GlbError('its meshes do not share their vertices');
    this.#shared = named;
    const position = this.#glb.accessor(POSITION);
    const normal = this.#glb.accessor(NORMAL);
    if (
      position.componentType !== SHORT ||
      normal.componentType !== BYTE ||
      normal.count !== position.count
    ) {
      throw new GlbError('its vertices are not quantised as expected');
    }
    this.positions = numbers(this.#glb, position, Int16Array, 4);
    this.normals = numbers(this.#glb, normal, Int8Array, 4);
  }

  #lay(index: unknown, vertices: number): void {
    if (this.#laid === index) return;
    if (this.#laid !== null) throw new GlbError('its meshes do not share their vertices');
    this.#laid = index;
    const uv = this.#glb.accessor(index);
    if (uv.componentType !== FLOAT || uv.count !== vertices)
      throw new GlbError('its textures have no coordinates');
    this.uvs = numbers(this.#glb, uv, Float32Array, 2);
  }
}

interface NumberArray<T> {
  new (buffer: ArrayBuffer): T;
  readonly BYTES_PER_ELEMENT: number;
}

/** Copies an accessor's numbers, `size` of them (padding included) for each element. */
function numbers<T>(glb: Glb, accessor: Accessor, type: NumberArray<T>, size: number): T {
  const view = glb.view(accessor.view);
  const end = accessor.offset + accessor.count * size * type.BYTES_PER_ELEMENT;
  if (end > view.length) throw new GlbError('an accessor reaches past the end');
  return new type(view.slice(accessor.offset, end).buffer as ArrayBuffer);
}

/** link_from_mesh of a node. */
function nodeTransform({
  translation = [0, 0, 0],
  rotation = [0, 0, 0, 1],
  scale = [1, 1, 1],
}: Raw): number[] {
  const all = [translation, rotation, scale].flat().map(Number);
  if (all.length !== 10 || !all.every(Number.isFinite)) throw new GlbError('a node without a valid position');
  const [x, y, z, qx, qy, qz, qw, s] = all as [
    number,
    number,
    number,
    number,
    number,
    number,
    number,
    number,
  ];
  return transform([x, y, z], [qw, qx, qy, qz], s);
}

/** Fetches and reads a level. Rejects with a one-line BundleError that names the file. */
export async function fetchLevel(
  file: LodFile,
  manifestUrl: string,
  visuals: number,
  signal: AbortSignal,
  onBytes: (received: number) => void,
): Promise<Lod> {
  const bytes = await lodBytes(file, manifestUrl, signal, onBytes);
  onBytes(file.bytes);
  try {
    return await readLod(bytes, visuals);
  } catch (cause) {
    throw new BundleError(`${file.path}: ${cause instanceof Error ? cause.message : String(cause)}`, {
      cause,
    });
  }
}
