/** Tells what a file is by its content, whatever its name says, as the edge does (posecast_edge.model.content). */

const HEAD = 64 << 10; // bytes in which a text says what it is
const LOOKED_AT = 1 << 20; // in which its first vertex or facet stands
const STL_HEADER = 84; // bytes
const STL_FACE = 50;

export const ROBOT = 'a robot description';
export const MESH = 'a mesh';
type Wanted = typeof ROBOT | typeof MESH;
export type MeshKind = 'stl' | 'collada' | 'obj' | 'glb' | 'gltf';

const EXPORT = 'export it as STL, Collada, OBJ or GLB';
const NAMES = 'give the URDF that names it';
const AS_URDF = 'export the robot as URDF';
const UNPACK = 'unpack it';
const WEBOTS = 'in Webots, right-click the robot and export it as URDF';
const PAGE = 'a server answered with a page';
const LFS = 'run git lfs pull';
const GAP = '[ \\t\\n\\v\\f\\r]';
const END = '[ \\t\\n\\v\\f\\r>]';
/** How a file begins: what it is, and what to do where a robot is wanted, and where a mesh is. */
const FOREIGN = (
  [
    [`${GAP}*<!doctype html|${GAP}*<head${END}|.{0,500}<html${END}`, 'an HTML page', PAGE, PAGE],
    [`${GAP}*version https://git-lfs`, 'a Git LFS pointer', LFS, LFS],
    [`pxr-usdc|${GAP}*#usda|pk\\x03\\x04.{26,200}\\.usd[ac]?`, 'a USD file', AS_URDF, EXPORT],
    ['pk\\x03\\x04', 'a zip archive', UNPACK, UNPACK],
    ['\\x1f\\x8b|bzh[1-9]|7z\\xbc\\xaf|rar!|\\xfd7zxz|\\x28\\xb5\\x2f\\xfd', 'a packed file', UNPACK, UNPACK],
    [`${GAP}*#vrml_sim|${GAP}*(?:extern)?proto${GAP}`, 'a Webots file', WEBOTS, EXPORT],
    [`${GAP}*#vrml v`, 'a VRML mesh', NAMES, EXPORT],
    [`ply${GAP}`, 'a PLY mesh', NAMES, EXPORT],
    ['kaydara fbx|; fbx', 'an FBX mesh', NAMES, EXPORT],
    [`${GAP}*iso-10303-21`, 'a STEP file', AS_URDF, EXPORT],
    ['blender', 'a Blender file', AS_URDF, EXPORT],
    ['\\x00\\x05\\x16\\x07', 'what a Mac notes about a file', 'give the file without ._ before its name', ''],
    ['\\x89png|\\xff\\xd8\\xff|gif8|riff.{4}webp', 'a picture', '', ''],
    ['%pdf', 'a PDF', '', ''],
  ] as const
).map(([begin, what, robot, mesh]) => ({ begin: new RegExp(`^(?:${begin})`, 'is'), what, robot, mesh }));
const MESHES: Readonly<Partial<Record<MeshKind, string>>> = {
  stl: 'an STL mesh',
  obj: 'an OBJ mesh',
  glb: 'a glTF mesh',
  gltf: 'JSON',
};

/** What the file is and what to do, if it is known to be something else than what is wanted; null otherwise. */
export function foreignTo(wanted: Wanted, bytes: Uint8Array): string | null {
  if (bytes.length === 0) return 'the file is empty';
  const head = textOf(bytes.subarray(0, 1024));
  const known = FOREIGN.find(({ begin }) => begin.test(head));
  if (known !== undefined) {
    const advice = wanted === ROBOT ? known.robot : known.mesh;
    const why = advice === EXPORT ? 'which is not supported' : `not ${wanted}`;
    return `${known.what}, ${why}${advice === '' ? '' : `: ${advice}`}`;
  }
  if (wanted === MESH) return null;
  const mesh = MESHES[meshKindOf(bytes) ?? 'collada'];
  if (mesh !== undefined) return `${mesh}, not ${wanted}: ${NAMES}`;
  return head.includes('\0') && !head.trimStart().startsWith('<') ? `binary data, not ${wanted}` : null;
}

/** The format of a mesh; null if it is none of them. */
export function meshKindOf(bytes: Uint8Array): MeshKind | null {
  if (textOf(bytes.subarray(0, 4)) === 'glTF') return 'glb';
  const { count, room, rest } = measureStl(bytes);
  if (rest === 0 && (count === room || count === 0)) return 'stl';
  const text = textOf(bytes.subarray(0, LOOKED_AT));
  const head = text.slice(0, HEAD);
  if (/<(?:\w+:)?COLLADA[ \t\n\v\f\r>]/.test(head)) return 'collada';
  const start = head.replace(/^[ \t\n\v\f\r]+/, '');
  if (start.startsWith('{')) return 'gltf';
  if (/^solid/i.test(start) && /\bfacet[ \t\n\v\f\r]+normal|\bendsolid\b/i.test(text)) return 'stl';
  if (count > 0 && count <= room) return 'stl';
  return !head.includes('\0') && /^[ \t]*v[ \t]+[^ \t\n\v\f\r]/m.test(text) ? 'obj' : null;
}

/** Of a binary STL: the triangles that its header claims, those for which it has room, and the bytes that are left over; -1 bytes
 *  if it is too short for a header. */
export function measureStl(bytes: Uint8Array): { count: number; room: number; rest: number } {
  if (bytes.length < STL_HEADER) return { count: 0, room: 0, rest: -1 };
  const count = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength).getUint32(80, true);
  const size = bytes.length - STL_HEADER;
  return { count, room: Math.floor(size / STL_FACE), rest: size % STL_FACE };
}

/** The encoding of text that begins as UTF-16 does, with its byte order mark, and XML also without it. */
export function wideEncoding([a, b]: Uint8Array): 'utf-16le' | 'utf-16be' | null {
  if ((a === 0xff && b === 0xfe) || (a === 0x3c && b === 0)) return 'utf-16le';
  return (a === 0xfe && b === 0xff) || (a === 0 && b === 0x3c) ? 'utf-16be' : null;
}

/** The beginning of a text, a character for each byte, without its byte order mark; UTF-16 decoded. */
function textOf(start: Uint8Array): string {
  const [a, b, c] = start;
  const wide = wideEncoding(start);
  if (wide !== null) return new TextDecoder(wide).decode(start);
  const marked = a === 0xef && b === 0xbb && c === 0xbf;
  return new TextDecoder('latin1').decode(marked ? start.subarray(3) : start);
}
