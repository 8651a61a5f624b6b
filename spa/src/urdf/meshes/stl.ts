/**
 * Reads STL files as a triangle soup: x, y, z of three corners for each face. Normals in the file are ignored, because
 * many exporters write zeros and `weld` computes better ones.
 */

export class MeshError extends Error {}

const HEADER = 84;
const FACE = 50;

/** Whether the size fits a binary STL: 84 bytes plus 50 for each face, and perhaps a few more at the end. Some binary files begin
 *  with "solid", so that word alone proves nothing. */
export function isBinaryStl(bytes: Uint8Array): boolean {
  if (bytes.length < HEADER) return false;
  const faces = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength).getUint32(80, true);
  const expected = HEADER + faces * FACE;
  return bytes.length === expected || (bytes.length > expected && faces > 0 && !isAsciiStl(bytes));
}

export function isAsciiStl(bytes: Uint8Array): boolean {
  const head = new TextDecoder('latin1').decode(bytes.subarray(0, 1024)).replace(/^[^a-zA-Z]*/, '');
  return /^solid/i.test(head) && /\bfacet\b|\bendsolid\b/i.test(head);
}

/** Number of bytes after the last triangle of a binary file. */
export function tailBytes(bytes: Uint8Array): number {
  if (!isBinaryStl(bytes)) return 0;
  const faces = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength).getUint32(80, true);
  return bytes.length - HEADER - faces * FACE;
}

export function parseStl(bytes: Uint8Array): Float32Array {
  return isBinaryStl(bytes) ? parseBinary(bytes) : parseAscii(new TextDecoder().decode(bytes));
}

function parseBinary(bytes: Uint8Array): Float32Array {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const faces = view.getUint32(80, true);
  const soup = new Float32Array(faces * 9);
  for (let face = 0; face < faces; face += 1) {
    const corners = HEADER + face * FACE + 12;
    for (let i = 0; i < 9; i += 1) soup[face * 9 + i] = view.getFloat32(corners + i * 4, true);
  }
  return soup;
}

function parseAscii(text: string): Float32Array {
  const numbers: number[] = [];
  for (const [, x, y, z] of text.matchAll(/\bvertex\s+(\S+)\s+(\S+)\s+(\S+)/gi)) {
    numbers.push(Number(x), Number(y), Number(z));
  }
  if (numbers.length % 9 !== 0) throw new MeshError('a facet without three corners');
  return Float32Array.from(numbers);
}
