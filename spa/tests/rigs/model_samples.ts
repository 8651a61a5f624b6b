import { MeshoptEncoder } from 'meshoptimizer/encoder';

/** Small built models for tests (docs/reference/model-bundle.md, version 2): boxes on links, packed as the builder packs them. */

export interface SampleJoint {
  readonly type: string;
  readonly parent: number;
  readonly xyz?: readonly number[];
  readonly quat?: readonly number[];
  readonly axis?: readonly number[];
  readonly mimic?: { joint: number; multiplier?: number; offset?: number };
}

export interface SampleVisual {
  readonly link: number;
  /** Middle and edge lengths, metres, in the link. */
  readonly at?: readonly [number, number, number];
  readonly size?: readonly [number, number, number];
  /** Index of a material; several visuals may name the same. */
  readonly material?: number;
  /** Visuals with the same number share one mesh, and so one `size`. */
  readonly mesh?: number;
}

export interface SampleMaterial {
  readonly color?: readonly [number, number, number, number];
  readonly picture?: number;
  readonly placeholder?: boolean;
}

export interface SampleModel {
  readonly joints: readonly SampleJoint[];
  readonly visuals: readonly SampleVisual[];
  readonly materials?: readonly SampleMaterial[];
  readonly pictures?: readonly Uint8Array[];
  /** The form that the builder writes if meshoptimizer is missing. */
  readonly unpacked?: boolean;
}

const UNITS = 1000; // mesh units per metre

/** The GLB of a sample model. `level` is written into it only to make the bytes of two levels differ. */
export async function sampleGlb(model: SampleModel, level = ''): Promise<Uint8Array> {
  await MeshoptEncoder.ready;
  const meshes = new Map<number, { first: number; start: number; material: number }>();
  const positions: number[] = [];
  const normals: number[] = [];
  const corners: number[] = [];
  const meshOf = model.visuals.map(({ size = [0.2, 0.2, 0.2], material = 0, mesh }, i) => {
    const key = mesh ?? 1000 + i;
    if (!meshes.has(key)) {
      meshes.set(key, { first: positions.length / 4, start: corners.length, material });
      addBox(size, positions, normals, corners);
    }
    return [...meshes.keys()].indexOf(key);
  });
  const pieces: Uint8Array[] = [];
  const bufferViews: object[] = [];
  let length = 0;
  const put = (bytes: Uint8Array) => {
    const at = length;
    const padded = new Uint8Array(Math.ceil(bytes.length / 4) * 4);
    padded.set(bytes);
    pieces.push(padded);
    length += padded.length;
    return { byteOffset: at, byteLength: bytes.length };
  };
  const pack = (bytes: Uint8Array, byteStride: number, mode: 'ATTRIBUTES' | 'TRIANGLES') => {
    if (model.unpacked) {
      const stride = mode === 'ATTRIBUTES' ? { byteStride } : {};
      bufferViews.push({ buffer: 0, ...stride, ...put(bytes) });
      return;
    }
    const count = bytes.length / byteStride;
    const packed = MeshoptEncoder.encodeGltfBuffer(bytes, count, byteStride, mode);
    bufferViews.push({
      buffer: 1,
      byteLength: bytes.length,
      extensions: { EXT_meshopt_compression: { buffer: 0, byteStride, count, mode, ...put(packed) } },
    });
  };
  pack(new Uint8Array(Int16Array.from(positions).buffer), 8, 'ATTRIBUTES');
  pack(new Uint8Array(Int8Array.from(normals).buffer), 4, 'ATTRIBUTES');
  pack(new Uint8Array(Uint32Array.from(corners).buffer), 4, 'TRIANGLES');
  const count = positions.length / 4;
  const textured = (model.pictures ?? []).length > 0;
  const accessors: object[] = [
    { bufferView: 0, componentType: 5122, count, type: 'VEC3' },
    { bufferView: 1, componentType: 5120, count, type: 'VEC3', normalized: true },
  ];
  if (textured) {
    pack(new Uint8Array(new Float32Array(count * 2).buffer), 8, 'ATTRIBUTES');
    accessors.push({ bufferView: 3, componentType: 5126, count, type: 'VEC2' });
  }
  const images = (model.pictures ?? []).map((bytes) => {
    bufferViews.push({ buffer: 0, ...put(bytes) });
    return { bufferView: bufferViews.length - 1, mimeType: 'image/png' };
  });
  const json = {
    asset: { version: '2.0', generator: `sample ${level}` },
    extensionsRequired: ['KHR_mesh_quantization', 'EXT_meshopt_compression'],
    extensionsUsed: ['KHR_mesh_quantization', 'EXT_meshopt_compression'],
    scenes: [{ nodes: model.visuals.map((_, i) => i) }],
    nodes: model.visuals.map(({ at = [0, 0, 0] }, i) => ({
      name: `v${i}`,
      mesh: meshOf[i],
      translation: at,
      rotation: [0, 0, 0, 1],
      scale: [1 / UNITS, 1 / UNITS, 1 / UNITS],
    })),
    meshes: [...meshes.values()].map(({ first, start, material }) => {
      accessors.push({
        bufferView: 2,
        byteOffset: start * 4,
        componentType: 5125,
        count: 36,
        type: 'SCALAR',
      });
      const pictured = model.materials?.[material]?.picture !== undefined;
      const attributes = { POSITION: 0, NORMAL: 1, ...(pictured ? { TEXCOORD_0: 2 } : {}) };
      return {
        primitives: [{ attributes, indices: accessors.length - 1, material, extras: { first, count: 24 } }],
      };
    }),
    materials: (model.materials ?? [{}]).map(({ color = [0.5, 0.5, 0.5, 1], picture, placeholder }) => ({
      pbrMetallicRoughness: {
        baseColorFactor: color,
        metallicFactor: 0,
        roughnessFactor: 0.7,
        ...(picture === undefined ? {} : { baseColorTexture: { index: picture } }),
      },
      alphaMode: color[3] < 1 ? 'BLEND' : 'OPAQUE',
      doubleSided: true,
      ...(placeholder === true ? { extras: { placeholder } } : {}),
    })),
    ...(images.length > 0 ? { images, textures: images.map((_, source) => ({ source })) } : {}),
    accessors,
    bufferViews,
    buffers: [{ byteLength: length }, { byteLength: count * 20 + corners.length * 4 }],
  };
  return container(new TextEncoder().encode(JSON.stringify(json)), pieces);
}

/** The manifest of a sample model; `levels` lists the real files. */
export function sampleManifest(
  model: SampleModel,
  levels: readonly { name: string; path: string; bytes: number; sha256: string }[],
): Record<string, unknown> {
  return {
    v: 2,
    robot: 'sample',
    files: levels.map(({ path, bytes, sha256 }) => ({
      path,
      size: bytes,
      sha256,
      type: 'model/gltf-binary',
    })),
    levels,
    links: ['base', ...model.joints.map((_, i) => `link${i + 1}`)],
    joints: model.joints.map((joint, i) => ({
      name: `joint${i + 1}`,
      child: i + 1,
      xyz: [0, 0, 0],
      quat: [1, 0, 0, 0],
      axis: [0, 0, 1],
      ...joint,
    })),
    visuals: model.visuals.map(({ link, at = [0, 0, 0], size = [0.2, 0.2, 0.2] }, i) => ({
      node: `v${i}`,
      link,
      source: `package://sample/${i}.stl`,
      box: [at.map((middle, k) => middle - size[k]! / 2), at.map((middle, k) => middle + size[k]! / 2)],
    })),
    sensors: [],
    missing: [],
    findings: [],
  };
}

/** Six faces of four corners each, with their normals. */
function addBox(size: readonly number[], positions: number[], normals: number[], corners: number[]): void {
  for (let axis = 0; axis < 3; axis += 1) {
    for (const side of [-1, 1]) {
      const first = positions.length / 4;
      for (const [u, v] of [
        [-1, -1],
        [1, -1],
        [1, 1],
        [-1, 1],
      ] as const) {
        const corner = [0, 0, 0];
        corner[axis] = side;
        corner[(axis + 1) % 3] = u;
        corner[(axis + 2) % 3] = v;
        positions.push(...corner.map((part, k) => Math.round((part * size[k]! * UNITS) / 2)), 0);
        normals.push(...[0, 1, 2].map((k) => (k === axis ? side * 127 : 0)), 0);
      }
      const [b, d] = side > 0 ? [1, 3] : [3, 1];
      corners.push(first, first + b, first + 2, first, first + 2, first + d);
    }
  }
}

function container(json: Uint8Array, pieces: readonly Uint8Array[]): Uint8Array {
  const text = new Uint8Array(Math.ceil(json.length / 4) * 4).fill(0x20);
  text.set(json);
  const binary = pieces.reduce((sum, piece) => sum + piece.length, 0);
  const bytes = new Uint8Array(28 + text.length + binary);
  const data = new DataView(bytes.buffer);
  data.setUint32(0, 0x46546c67, true);
  data.setUint32(4, 2, true);
  data.setUint32(8, bytes.length, true);
  data.setUint32(12, text.length, true);
  data.setUint32(16, 0x4e4f534a, true);
  bytes.set(text, 20);
  let at = 20 + text.length;
  data.setUint32(at, binary, true);
  data.setUint32(at + 4, 0x004e4942, true);
  at += 8;
  for (const piece of pieces) {
    bytes.set(piece, at);
    at += piece.length;
  }
  return bytes;
}
