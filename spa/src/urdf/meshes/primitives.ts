import { transform } from '../../model/kinematics.ts';
import type { Bone } from '../bones.ts';
import type { Paint, PlacedShape } from '../manifest.ts';
import type { Shape } from '../types.ts';
import type { PaintedSurface } from './lod_builder.ts';
import { type Welded, weld } from './weld.ts';

/** The URDF's primitive shapes as surfaces around their centre, metres, with z along the length. */

const AROUND = 48;
/** Rings of a sphere from pole to pole. */
const RINGS = 24;

/** The surface of a box (dims x, y, z), cylinder or capsule (radius, length) or sphere (radius). */
export function surfaceOf({ kind, dims }: Pick<Shape, 'kind' | 'dims'>): Welded {
  const [first = 0, second = 0, third = 0] = dims;
  switch (kind) {
    case 'box':
      return weld(boxSoup(first, second, third));
    case 'cylinder':
      return weld(
        turned([
          [0, -second / 2],
          [first, -second / 2],
          [first, second / 2],
          [0, second / 2],
        ]),
      );
    default:
      return weld(turned(roundProfile(first, kind === 'capsule' ? second / 2 : 0)));
  }
}

/** A profile from pole to pole: two halves of a ball, `half` metres above and below the middle. */
function roundProfile(radius: number, half: number): (readonly [r: number, z: number])[] {
  return [-1, 1].flatMap((side) =>
    Array.from({ length: RINGS / 2 + 1 }, (_, i) => {
      const angle = (side < 0 ? i - RINGS / 2 : i) * (Math.PI / RINGS);
      return [radius * Math.cos(angle), radius * Math.sin(angle) + side * half] as const;
    }),
  );
}

/** Triangle corners of a profile (from bottom to top) rotated about z. */
function turned(profile: readonly (readonly [r: number, z: number])[]): Float32Array {
  const corner = (ring: number, turn: number) => {
    const [r, z] = profile[ring]!;
    const angle = ((turn % AROUND) / AROUND) * 2 * Math.PI;
    return [r * Math.cos(angle), r * Math.sin(angle), z];
  };
  const soup: number[] = [];
  for (let ring = 1; ring < profile.length; ring += 1) {
    for (let turn = 0; turn < AROUND; turn += 1) {
      const [a, b] = [corner(ring - 1, turn), corner(ring - 1, turn + 1)];
      const [c, d] = [corner(ring, turn + 1), corner(ring, turn)];
      soup.push(...a, ...b, ...c, ...a, ...c, ...d);
    }
  }
  return Float32Array.from(soup);
}

/** The sides of a box, counterclockwise from the lower left. Bits 0, 1, 2 of a corner are its x, y, z. */
const SIDES = [
  [0, 4, 6, 2],
  [1, 3, 7, 5],
  [0, 1, 5, 4],
  [2, 6, 7, 3],
  [0, 2, 3, 1],
  [4, 5, 7, 6],
] as const;

function boxSoup(x: number, y: number, z: number): Float32Array {
  const corner = (bits: number) => [
    bits & 1 ? x / 2 : -x / 2,
    bits & 2 ? y / 2 : -y / 2,
    bits & 4 ? z / 2 : -z / 2,
  ];
  return Float32Array.from(
    SIDES.flatMap(([a, b, c, d]) => [a, b, c, a, c, d].flatMap((bits) => corner(bits))),
  );
}

/** The colour of a joint's axis between bones: #5c85c7 in linear light, as the edge paints it. */
const AXIS: Paint = [0.1065, 0.233, 0.5705, 1];

/** The mesh of a shape that needs no file, or of a link's bones. */
export function ownMesh({ shape, bones }: PlacedShape): PaintedSurface[] {
  return bones?.map(surfaceOfBone) ?? [{ surface: surfaceOf(shape), paint: null }];
}

function surfaceOfBone({ kind, dims, xyz, quat, isAxis }: Bone): PaintedSurface {
  const { positions, normals, index } = surfaceOf({ kind, dims });
  const surface = {
    positions: moved(positions, transform(xyz, quat)),
    normals: moved(normals, transform([0, 0, 0], quat)),
    index,
  };
  return { surface, paint: isAxis ? AXIS : null };
}

function moved(points: Float32Array, m: readonly number[]): Float32Array {
  return points.map((_, i) => {
    const [at, row] = [i - (i % 3), i % 3];
    const turned = m[row]! * points[at]! + m[row + 4]! * points[at + 1]! + m[row + 8]! * points[at + 2]!;
    return turned + m[row + 12]!;
  });
}
