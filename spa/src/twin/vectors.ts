import type { Vec3 } from './rotation.ts';

/** A rigid transform: 16 numbers, column-major like three.js, without scale. */
export type Transform = ArrayLike<number>;

/** a + by · b. */
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

/** The part of a vector perpendicular to a unit axis. */
export function rejectFrom(a: Vec3, axis: Vec3): Vec3 {
  return addScaled(a, axis, -dot(a, axis));
}

/** Scales a vector to length one; the zero vector stays as it is. */
export function normalize(a: Vec3): Vec3 {
  const length = Math.hypot(...a);
  return length > 0 ? scale(a, 1 / length) : a;
}

/** Rotates `v` about a unit axis by `angle` rad (Rodrigues' formula). */
export function rotateAbout(axis: Vec3, angle: number, v: Vec3): Vec3 {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return addScaled(addScaled(scale(v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

/** Transforms a point from the inner frame to the outer one. */
export function pointThrough(m: Transform, [x, y, z]: Vec3): Vec3 {
  return [
    m[0]! * x + m[4]! * y + m[8]! * z + m[12]!,
    m[1]! * x + m[5]! * y + m[9]! * z + m[13]!,
    m[2]! * x + m[6]! * y + m[10]! * z + m[14]!,
  ];
}
