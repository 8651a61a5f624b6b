/**
 * Welds a triangle soup into an indexed surface with smooth normals that keep real edges.
 *
 * STL has only flat triangles, so a rounded surface would look like cut glass. Corners at exactly the same place become one
 * vertex; a corner's normal is the area-weighted mean of those adjacent faces whose angle to its own face is below the crease
 * angle; corners with equal normals share an index (about five times fewer vertices).
 */

export interface Welded {
  positions: Float32Array;
  normals: Float32Array;
  index: Uint32Array;
}

const CREASE_RAD = (40 * Math.PI) / 180;
/** Faces around one vertex are compared in pairs; with more faces than this, the vertex keeps flat normals. */
const MAX_FACES_AT_VERTEX = 256;
const SAME_NORMAL = 0.9998;

/** Welds a soup (9 numbers a face, metres). Faces without area or with a non-finite number are dropped. */
export function weld(soup: Float32Array, creaseRad = CREASE_RAD): Welded {
  const { corners, flat, faces } = sound(soup);
  const vertexOf = sharedVertices(corners, faces * 3);
  const { start, around } = cornersByVertex(vertexOf);
  const cosCrease = Math.cos(creaseRad);

  const positions = new Float32Array(faces * 9);
  const normals = new Float32Array(faces * 9);
  const index = new Uint32Array(faces * 3);
  let count = 0;
  for (let vertex = 0; vertex + 1 < start.length; vertex += 1) {
    const from = start[vertex]!;
    const to = start[vertex + 1]!;
    const first = count; // this vertex's outputs are first … count
    for (let i = from; i < to; i += 1) {
      const corner = around[i]!;
      const f = Math.floor(corner / 3) * 4;
      let x = flat[f]!;
      let y = flat[f + 1]!;
      let z = flat[f + 2]!;
      if (to - from <= MAX_FACES_AT_VERTEX) {
        let sx = 0;
        let sy = 0;
        let sz = 0;
        for (let j = from; j < to; j += 1) {
          const g = Math.floor(around[j]! / 3) * 4;
          if (x * flat[g]! + y * flat[g + 1]! + z * flat[g + 2]! < cosCrease) continue;
          const area = flat[g + 3]!;
          sx += area * flat[g]!;
          sy += area * flat[g + 1]!;
          sz += area * flat[g + 2]!;
        }
        const length = Math.hypot(sx, sy, sz);
        x = sx / length;
        y = sy / length;
        z = sz / length;
      }
      let output = Math.max(first, count - MAX_FACES_AT_VERTEX);
      while (
        output < count &&
        normals[output * 3]! * x + normals[output * 3 + 1]! * y + normals[output * 3 + 2]! * z < SAME_NORMAL
      ) {
        output += 1;
      }
      if (output === count) {
        count += 1;
        positions.set(corners.subarray(corner * 3, corner * 3 + 3), output * 3);
        normals[output * 3] = x;
        normals[output * 3 + 1] = y;
        normals[output * 3 + 2] = z;
      }
      index[corner] = output;
    }
  }
  return {
    positions: positions.slice(0, count * 3),
    normals: normals.slice(0, count * 3),
    index,
  };
}

/** The valid faces: their corners, and for each a unit normal and twice the area. */
function sound(soup: Float32Array): { corners: Float32Array; flat: Float32Array; faces: number } {
  const total = Math.floor(soup.length / 9);
  const corners = new Float32Array(total * 9);
  const flat = new Float32Array(total * 4);
  let faces = 0;
  for (let at = 0; at < total * 9; at += 9) {
    const ux = soup[at + 3]! - soup[at]!;
    const uy = soup[at + 4]! - soup[at + 1]!;
    const uz = soup[at + 5]! - soup[at + 2]!;
    const vx = soup[at + 6]! - soup[at]!;
    const vy = soup[at + 7]! - soup[at + 1]!;
    const vz = soup[at + 8]! - soup[at + 2]!;
    const nx = uy * vz - uz * vy;
    const ny = uz * vx - ux * vz;
    const nz = ux * vy - uy * vx;
    const area = Math.hypot(nx, ny, nz);
    if (!(area > 1e-20) || !Number.isFinite(area)) continue;
    for (let i = 0; i < 9; i += 1) corners[faces * 9 + i] = soup[at + i]! + 0; // -0 and 0 are the same place
    flat[faces * 4] = nx / area;
    flat[faces * 4 + 1] = ny / area;
    flat[faces * 4 + 2] = nz / area;
    flat[faces * 4 + 3] = area;
    faces += 1;
  }
  return { corners: corners.subarray(0, faces * 9), flat, faces };
}

/** Maps each corner to a vertex by equal coordinates. It is an open-addressing hash table on the floats' bits, with a
 *  random hash, so that no file can be made to collide on purpose. */
function sharedVertices(corners: Float32Array, count: number): Uint32Array {
  const bits = new Uint32Array(corners.buffer, corners.byteOffset, corners.length);
  const mask = 2 ** Math.ceil(Math.log2(Math.max(2, count * 2))) - 1;
  const table = new Int32Array(mask + 1).fill(-1); // slot → first corner seen there
  const vertexOf = new Uint32Array(count);
  const [ka = 0, kb = 0, kc = 0] = crypto.getRandomValues(new Uint32Array(3)).map((key) => key | 1);
  let vertices = 0;
  for (let corner = 0; corner < count; corner += 1) {
    const a = bits[corner * 3]!;
    const b = bits[corner * 3 + 1]!;
    const c = bits[corner * 3 + 2]!;
    let hash = Math.imul(a, ka) ^ Math.imul(b, kb) ^ Math.imul(c, kc);
    hash = Math.imul(hash ^ (hash >>> 15), 0x2c1b3c6d);
    let slot = (hash ^ (hash >>> 13)) & mask;
    for (;;) {
      const other = table[slot]!;
      if (other < 0) {
        table[slot] = corner;
        vertexOf[corner] = vertices;
        vertices += 1;
        break;
      }
      if (bits[other * 3] === a && bits[other * 3 + 1] === b && bits[other * 3 + 2] === c) {
        vertexOf[corner] = vertexOf[other]!;
        break;
      }
      slot = (slot + 1) & mask;
    }
  }
  return vertexOf;
}

/** Vertex → its corners, as one list (`around`) and the start of each vertex's part in it. */
function cornersByVertex(vertexOf: Uint32Array): { start: Uint32Array; around: Uint32Array } {
  let vertices = 0;
  for (const vertex of vertexOf) vertices = Math.max(vertices, vertex + 1);
  const start = new Uint32Array(vertices + 1);
  for (const vertex of vertexOf) start[vertex + 1]! += 1;
  for (let vertex = 0; vertex < vertices; vertex += 1) start[vertex + 1]! += start[vertex]!;
  const next = start.slice();
  const around = new Uint32Array(vertexOf.length);
  for (let corner = 0; corner < vertexOf.length; corner += 1) {
    const vertex = vertexOf[corner]!;
    around[next[vertex]!] = corner;
    next[vertex]! += 1;
  }
  return { start, around };
}
