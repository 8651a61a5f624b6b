// biome-ignore lint/style/noRestrictedImports: the decoder is standalone and does not pull in three.js
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { isRecord } from './bundle.ts';

/**
 * Reads the container of a level of detail: binary glTF 2.0 (GLB) whose buffer views are packed with meshopt. It reads only what
 * docs/reference/model-bundle.md describes, so it is a tenth of the size of a general loader; every length is checked before use.
 */

/** A level's file is unreadable; the message says why. */
export class GlbError extends Error {}

type Raw = Readonly<Record<string, unknown>>;

const GLTF = 0x46546c67;
const JSON_CHUNK = 0x4e4f534a;
const BINARY_CHUNK = 0x004e4942;
/** The most bytes that all views of a level may decompress to. */
export const MAX_UNPACKED_BYTES = 512_000_000;
/** At best, meshopt packs sixteen equal bytes into two bits; data that claim a higher ratio are rejected. */
const MAX_GROWTH = 64;
const STRIDES: Readonly<Record<string, (stride: number) => boolean>> = {
  ATTRIBUTES: (stride) => stride > 0 && stride <= 256 && stride % 4 === 0,
  TRIANGLES: (stride) => stride === 2 || stride === 4,
  INDICES: (stride) => stride === 2 || stride === 4,
};

/** A glTF accessor: `count` elements of its view, from byte `offset` on. */
export interface Accessor {
  readonly view: number;
  readonly offset: number;
  readonly count: number;
  readonly componentType: number;
  readonly type: string;
}

/** An opened GLB file. All methods throw GlbError if the file does not follow the format. */
export class Glb {
  readonly #json: Raw;
  readonly #binary: Uint8Array;
  readonly #views = new Map<number, Uint8Array>();
  readonly #lists = new Map<string, readonly Raw[]>();
  #unpacked = 0;

  private constructor(json: Raw, binary: Uint8Array) {
    this.#json = json;
    this.#binary = binary;
  }

  /** Opens a file. Rejects with GlbError if it is not GLB version 2. */
  static async read(bytes: Uint8Array): Promise<Glb> {
    const data = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    if (bytes.length < 20 || data.getUint32(0, true) !== GLTF) throw new GlbError('not a GLB file');
    if (data.getUint32(4, true) !== 2) throw new GlbError('not glTF 2');
    let json: unknown;
    let binary = new Uint8Array();
    for (let at = 12; at + 8 <= bytes.length; ) {
      const length = data.getUint32(at, true);
      const type = data.getUint32(at + 4, true);
      if (length > bytes.length - at - 8) throw new GlbError('a chunk is cut short');
      const chunk = bytes.subarray(at + 8, at + 8 + length);
      if (type === JSON_CHUNK && json === undefined) json = parse(chunk);
      else if (type === BINARY_CHUNK) binary = chunk as Uint8Array<ArrayBuffer>;
      at += 8 + length + ((4 - (length % 4)) % 4);
    }
    if (!isRecord(json)) throw new GlbError('its JSON is not an object');
    await MeshoptDecoder.ready;
    return new Glb(json, binary);
  }

  /** The entries of one of the document's lists: nodes, meshes, materials, … */
  list(name: string): readonly Raw[] {
    const known = this.#lists.get(name);
    if (known !== undefined) return known;
    const value = this.#json[name] ?? [];
    if (!Array.isArray(value) || !value.every(isRecord))
      throw new GlbError(`${name} is not a list of objects`);
    this.#lists.set(name, value);
    return value;
  }

  accessor(index: unknown): Accessor {
    const raw = this.#entry('accessors', index);
    const { bufferView, byteOffset = 0, count, componentType, type } = raw;
    if (!isSize(bufferView) || !isSize(byteOffset) || !isSize(count))
      throw new GlbError('an accessor without data');
    return {
      view: bufferView,
      offset: byteOffset,
      count,
      componentType: Number(componentType),
      type: String(type),
    };
  }

  /** The bytes of a buffer view, unpacked at the first call. */
  view(index: unknown): Uint8Array {
    const raw = this.#entry('bufferViews', index);
    let bytes = this.#views.get(index as number);
    if (bytes === undefined) {
      const extensions = isRecord(raw.extensions) ? raw.extensions : {};
      const packed = extensions.EXT_meshopt_compression ?? extensions.KHR_meshopt_compression;
      bytes = isRecord(packed) ? this.#unpack(packed) : this.#slice(raw);
      this.#views.set(index as number, bytes);
    }
    return bytes;
  }

  #entry(name: string, index: unknown): Raw {
    const entry = isSize(index) ? this.list(name)[index] : undefined;
    if (entry === undefined) throw new GlbError(`${name} has no entry ${String(index)}`);
    return entry;
  }

  #slice({ byteOffset = 0, byteLength }: Raw): Uint8Array {
    if (!isSize(byteOffset) || !isSize(byteLength) || byteOffset + byteLength > this.#binary.length) {
      throw new GlbError('a buffer view reaches past the end');
    }
    return this.#binary.subarray(byteOffset, byteOffset + byteLength);
  }

  #unpack(packed: Raw): Uint8Array {
    const { byteStride: stride, count, mode, filter = 'NONE' } = packed;
    const fits = typeof mode === 'string' && Object.hasOwn(STRIDES, mode) ? STRIDES[mode] : undefined;
    if (!isSize(stride) || !isSize(count) || fits?.(stride) !== true || filter !== 'NONE') {
      throw new GlbError('unknown packing');
    }
    this.#unpacked += count * stride;
    if (this.#unpacked > MAX_UNPACKED_BYTES) throw new GlbError('unpacks to too many bytes');
    const slice = this.#slice(packed);
    if (count * stride > MAX_GROWTH * slice.length) throw new GlbError('its packing is damaged');
    const bytes = new Uint8Array(count * stride);
    try {
      MeshoptDecoder.decodeGltfBuffer(bytes, count, stride, slice, mode as string, 'NONE');
    } catch (cause) {
      throw new GlbError('its packing is damaged', { cause });
    }
    return bytes;
  }
}

function parse(chunk: Uint8Array): unknown {
  try {
    return JSON.parse(new TextDecoder().decode(chunk));
  } catch {
    throw new GlbError('its JSON is damaged');
  }
}

export function isSize(value: unknown): value is number {
  return Number.isSafeInteger(value) && (value as number) >= 0;
}
