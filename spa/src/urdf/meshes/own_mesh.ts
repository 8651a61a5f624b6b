import { transform } from '../../model/kinematics.ts';
import type { Bone } from '../bones.ts';
import type { Paint, PlacedShape } from '../manifest.ts';
import type { PaintedSurface } from './lod_builder.ts';
import { surfaceOf } from './primitives.ts';

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
