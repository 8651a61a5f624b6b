import type { Quat, Vec3 } from '../twin/rotation.ts';

/** Points and directions for what is drawn about a robot, with or without three.js. Transforms: 16 numbers, column after
 *  column, as three keeps them; what they turn keeps its length. */
export type Transform = ArrayLike<number>;

/** a + by · b */
export function addScaled(a: Vec3, b: Vec3, by = 1): Vec3 {
  return [a[0] + by * b[0], a[1] + by * b[1], a[2] + by * b[2]];
}

export function scale(a: Vec3, by: number): Vec3 {
  return [a[0] * by, a[1] * by, a[2] * by];
}

export function dot(a: Vec3, b: Vec3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vec3, b: Vec3): Vec3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** What is left of a vector across a unit axis. */
export function rejectFrom(a: Vec3, axis: Vec3): Vec3 {
  return addScaled(a, axis, -dot(a, axis));
}

/** Made to length one; a vector without a direction stays as it is. */
export function normalize(a: Vec3): Vec3 {
  const length = Math.hypot(...a);
  return length > 0 ? scale(a, 1 / length) : a;
}

/** Turned about a unit axis, rad (Rodrigues' formula). */
export function rotateAbout(axis: Vec3, angle: number, v: Vec3): Vec3 {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return addScaled(addScaled(scale(v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

/** A point of the inner frame, seen from the outer one. */
export function pointThrough(m: Transform, [x, y, z]: Vec3): Vec3 {
  return [
    m[0]! * x + m[4]! * y + m[8]! * z + m[12]!,
    m[1]! * x + m[5]! * y + m[9]! * z + m[13]!,
    m[2]! * x + m[6]! * y + m[10]! * z + m[14]!,
  ];
}

/** A direction of the inner frame, seen from the outer one, of length one; zero stays zero. */
export function directionThrough(m: Transform, [x, y, z]: Vec3): Vec3 {
  return normalize([
    m[0]! * x + m[4]! * y + m[8]! * z,
    m[1]! * x + m[5]! * y + m[9]! * z,
    m[2]! * x + m[6]! * y + m[10]! * z,
  ]);
}

/** Where the inner frame's origin is. */
export function originOf(m: Transform): Vec3 {
  return [m[12]!, m[13]!, m[14]!];
}

/** How a transform turns, by its largest part first, so that half turns are exact, too (Shepperd 1978). */
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
