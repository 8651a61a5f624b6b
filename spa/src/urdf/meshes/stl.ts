import { measureStl, meshKindOf } from '../content.ts';
import { readText } from '../text.ts';

/**
 * Reads STL files as a triangle soup: x, y, z of three corners for each face. Normals in the file are ignored, because
 * many exporters write zeros and `weld` computes better ones.
 */

export class MeshError extends Error {}

const HEADER = 84;
const FACE = 50;

/** The triangles of a file, and what the reader had to work around. Throws MeshError. */
export function parseStl(bytes: Uint8Array): { soup: Float32Array; notes: [code: string, text: string][] } {
  const { count, room, rest } = measureStl(bytes);
  const number = (value: number) => value.toLocaleString('en-US');
  if (rest === 0 && (count === room || count === 0)) {
    const claim = `its header claims no triangles; the file's ${number(room)} are shown`;
    return { soup: parseBinary(bytes, room), notes: count === room ? [] : [['stl-count', claim]] };
  }
  if (meshKindOf(bytes) === 'stl' && !(count > 0 && count <= room))
    return { soup: parseAscii(readText(bytes).text), notes: [] };
  if (count === 0 || count > room)
    throw new MeshError(
      `the STL's header claims ${number(count)} triangles, the file has room for ${number(room)}`,
    );
  const tail = bytes.length - HEADER - count * FACE;
  return { soup: parseBinary(bytes, count), notes: [['stl-tail', `${tail} bytes after the last triangle`]] };
}

function parseBinary(bytes: Uint8Array, faces: number): Float32Array {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
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
  if (numbers.some(Number.isNaN)) throw new MeshError('a vertex of the text STL is not a number');
  if (numbers.length % 9 !== 0) throw new MeshError('the text STL ends within a triangle');
  return Float32Array.from(numbers);
}
