import { addScaled, normalize, type Quat, type Transform, type Vec3 } from '../twin/rotation.ts';

/** Vector algebra for everything drawn about a robot, independent of three.js. */
export {
  addScaled,
  cross,
  dot,
  normalize,
  pointThrough,
  quatOfRpy,
  rejectFrom,
  rotateAbout,
  rpyOf,
  scale,
  type Transform,
} from '../twin/rotation.ts';

/** Rotates a direction from the inner frame to the outer one and scales it to length one; zero stays zero. */
export function directionThrough(m: Transform, [x, y, z]: Vec3): Vec3 {
  return normalize([
    m[0]! * x + m[4]! * y + m[8]! * z,
    m[1]! * x + m[5]! * y + m[9]! * z,
    m[2]! * x + m[6]! * y + m[10]! * z,
  ]);
}

/** The inner frame's origin in the outer frame. */
export function originOf(m: Transform): Vec3 {
  return [m[12]!, m[13]!, m[14]!];
}

/** The rotation of a transform as a unit quaternion. It starts from the largest component, so that half turns are exact as well
 *  (Shepperd 1978). */
export function quatOfTransform(m: Transform): Quat {
  const [xx, yy, zz] = [m[0]!, m[5]!, m[10]!];
  const [yz, zx, xy] = [m[6]! - m[9]!, m[8]! - m[2]!, m[1]! - m[4]!];
  const [syz, szx, sxy] = [m[6]! + m[9]!, m[8]! + m[2]!, m[1]! + m[4]!];
  const [w4, x4, y4, z4] = [1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz];
  const most = Math.max(w4, x4, y4, z4);
  const half = 0.5 / Math.sqrt(most);
  if (most === w4) return [most * half, yz * half, zx * half, xy * half];
  if (most === x4) return [yz * half, most * half, sxy * half, szx * half];
  if (most === y4) return [zx * half, sxy * half, most * half, syz * half];
  return [xy * half, szx * half, syz * half, most * half];
}

/** The point that a transform (column-major, without scale) maps to `point`. */
export function pointBefore(transform: Float64Array, point: Vec3): Vec3 {
  const [x, y, z] = addScaled(point, originOf(transform), -1);
  const along = (i: number) => transform[i]! * x + transform[i + 1]! * y + transform[i + 2]! * z;
  return [along(0), along(4), along(8)];
}
