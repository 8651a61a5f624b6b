import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js'; // loaded anyway: built models need it
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { isRecord } from '../../model/bundle.ts';
import type { MeshNote } from '../../model/report.ts';
import { MeshError } from '../../urdf/meshes/stl.ts';
import { type LoadedMesh, NO_PICTURES, offline, partsOf } from './loaded_mesh.ts';

/** Reads GLB, like the edge (posecast_edge.model.meshes.gltf), but without pictures. A problem of a material never costs the shape. */

/** What a required extension may be: one that is read, or that only changes how a surface looks. */
const KNOWN =
  /^(KHR_mesh_quantization|EXT_meshopt_compression|(KHR|EXT|MSFT|ADOBE|FB|GODOT)_(materials?|texture|lights?|xmp|animation)_?.*)$/;
const COMPRESSED = /^(KHR_draco_mesh_compression|(EXT|KHR)_meshopt_compression)$/;
/** What the loader needs to hear of; it fails over others, or fetches their pictures. */
const READ = new Set(['KHR_mesh_quantization', 'EXT_meshopt_compression']);
const MAX_JSON = 16 << 20;
const TOO_LONG = 'its JSON is longer than the file, or than 16 MiB';
/** In glTF, y is up; it is turned to z, as RViz does. */
const TURNED: MeshNote = ['gltf-axis', 'the y axis of glTF is up; turned to z'];
const UNREADABLE: MeshNote = ['material', "a material in it can't be read; it is shown without"];

type Json = Record<string, unknown>;

/** Reads a self-contained GLB. Rejects with MeshError, or with an error of the loader if the file is broken. */
export async function readGlb(bytes: Uint8Array): Promise<LoadedMesh> {
  const { document, binary } = chunksOf(bytes);
  refuseUnknown(document);
  const notes: MeshNote[] = [TURNED];
  simplify(document, notes);
  const loader = new GLTFLoader(offline()).setMeshoptDecoder(MeshoptDecoder);
  const { scene } = await loader.parseAsync(packed(document, binary), '');
  scene.matrixAutoUpdate = false;
  scene.matrix.set(1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1);
  return { parts: partsOf(scene, true), notes };
}

function chunksOf(bytes: Uint8Array): { document: Json; binary: Uint8Array } {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 20 || view.getUint32(4, true) !== 2) throw new MeshError('not a glTF 2.0 binary');
  const length = view.getUint32(12, true);
  if (view.getUint32(16, true) !== 0x4e4f534a || length > bytes.length - 20 || length > MAX_JSON)
    throw new MeshError(TOO_LONG);
  const document = jsonOf(new TextDecoder().decode(bytes.subarray(20, 20 + length)));
  const at = 20 + length;
  const hasBinary = at + 8 <= bytes.length && view.getUint32(at + 4, true) === 0x004e4942;
  const end = hasBinary ? at + 8 + view.getUint32(at, true) : at;
  return { document, binary: bytes.subarray(hasBinary ? at + 8 : at, end) };
}

function jsonOf(text: string): Json {
  let document: unknown;
  try {
    document = JSON.parse(text);
  } catch {
    throw new MeshError('its JSON is invalid');
  }
  if (!isRecord(document)) throw new MeshError('its JSON is invalid');
  return document;
}

function refuseUnknown({ extensionsRequired: required = [] }: Json): void {
  const names = (Array.isArray(required) ? required : [required]).map(String).sort();
  const unknown = names.find((name) => !KNOWN.test(name));
  if (unknown === undefined) return;
  const how = COMPRESSED.test(unknown) ? 'compression' : 'this extension';
  throw new MeshError(`it needs ${unknown.slice(0, 60)}; export it without ${how}`);
}

/** Leaves only what is drawn: shapes with one colour each. */
function simplify(document: Json, notes: MeshNote[]): void {
  for (const key of ['extensionsUsed', 'extensionsRequired']) {
    const names = document[key];
    if (Array.isArray(names)) document[key] = names.filter((name) => READ.has(name));
  }
  for (const key of ['textures', 'images', 'samplers', 'animations', 'cameras', 'extensions'])
    delete document[key];
  for (const node of recordsOf(document.nodes)) {
    for (const key of ['camera', 'skin', 'extensions']) delete node[key];
  }
  if (document.scenes === undefined) {
    const nodes = recordsOf(document.nodes);
    const below = new Set(nodes.flatMap(({ children }) => (Array.isArray(children) ? children : [])));
    document.scenes = [{ nodes: [...nodes.keys()].filter((node) => !below.has(node)) }];
    document.scene = 0;
  }
  const materials: unknown[] = Array.isArray(document.materials) ? document.materials : [];
  const looks = materials.map(lookOf);
  document.materials = looks.map((look) => look ?? {});
  for (const primitive of recordsOf(document.meshes).flatMap((mesh) => recordsOf(mesh.primitives))) {
    delete primitive.targets;
    const { material } = primitive;
    if (material === undefined) continue;
    const look = looks[material as number] ?? null;
    if (look === null) delete primitive.material;
    const note = look === null ? UNREADABLE : look.pictured ? NO_PICTURES : null;
    if (note !== null && !notes.includes(note)) notes.push(note);
  }
}

/** A material with its colour alone; null if that can't be read. Its name says that the file has it. */
function lookOf(material: unknown): (Json & { readonly pictured: boolean }) | null {
  if (!isRecord(material)) return null;
  const { extensions = {}, pbrMetallicRoughness: pbr = {} } = material;
  if (!isRecord(extensions)) return null;
  const glossy = extensions.KHR_materials_pbrSpecularGlossiness;
  const source = glossy ?? pbr;
  if (!isRecord(source)) return null;
  const factor = (glossy === undefined ? source.baseColorFactor : source.diffuseFactor) ?? [1, 1, 1, 1];
  if (!Array.isArray(factor) || factor.length !== 4 || !factor.every(Number.isFinite)) return null;
  const [r, g, b, a] = factor.map((value) => Math.min(Math.max(value, 0), 1));
  const opacity = material.alphaMode === 'BLEND' && a! >= 0.02 ? a : 1;
  return {
    name: 'own',
    pbrMetallicRoughness: { baseColorFactor: [r, g, b, opacity] },
    ...(opacity === 1 ? {} : { alphaMode: 'BLEND' }),
    pictured: (glossy === undefined ? source.baseColorTexture : source.diffuseTexture) !== undefined,
  };
}

function recordsOf(list: unknown): Json[] {
  return Array.isArray(list) ? list.filter(isRecord) : [];
}

/** A GLB of these parts. */
function packed(document: Json, binary: Uint8Array): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(document));
  const room = Math.ceil(text.length / 4) * 4;
  const bytes = new Uint8Array(28 + room + binary.length);
  const view = new DataView(bytes.buffer);
  for (const [i, value] of [0x46546c67, 2, bytes.length, room, 0x4e4f534a].entries())
    view.setUint32(4 * i, value, true);
  bytes.fill(0x20, 20, 20 + room);
  bytes.set(text, 20);
  view.setUint32(20 + room, binary.length, true);
  view.setUint32(24 + room, 0x004e4942, true);
  bytes.set(binary, 28 + room);
  return bytes.buffer;
}
