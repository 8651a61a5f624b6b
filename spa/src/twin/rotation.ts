/** A rotation as a unit quaternion w, x, y, z. `world_from_link` turns a vector from the link's frame into the world's.
 *  */
export type Quat = readonly [w: number, x: number, y: number, z: number];
export type Vec3 = readonly [x: number, y: number, z: number];

export const IDENTITY: Quat = [1, 0, 0, 0];

/** Scales a quaternion to length one; null if it has no direction (zero, NaN, infinite). */
export function normalizeQuat([w, x, y, z]: Quat): Quat | null {
  const length = Math.hypot(w, x, y, z);
  return length > 1e-6 && Number.isFinite(length) ? [w / length, x / length, y / length, z / length] : null;
}

/** The Hamilton product: a_from_c = a_from_b · b_from_c. */
export function multiplyQuats([aw, ax, ay, az]: Quat, [bw, bx, by, bz]: Quat): Quat {
  return [
    aw * bw - ax * bx - ay * by - az * bz,
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
  ];
}

export function invertQuat([w, x, y, z]: Quat): Quat {
  return [w, -x, -y, -z];
}

export function rotateVector(q: Quat, [x, y, z]: Vec3): Vec3 {
  const [, rx, ry, rz] = multiplyQuats(multiplyQuats(q, [0, x, y, z]), invertQuat(q));
  return [rx, ry, rz];
}

/** The quaternion of roll, pitch and yaw (rad) about the fixed axes X, Y and Z, as in URDF. */
export function quatOfRpy([roll, pitch, yaw]: Vec3): Quat {
  const [cr, cp, cy] = [Math.cos(roll / 2), Math.cos(pitch / 2), Math.cos(yaw / 2)];
  const [sr, sp, sy] = [Math.sin(roll / 2), Math.sin(pitch / 2), Math.sin(yaw / 2)];
  return [
    cr * cp * cy + sr * sp * sy,
    sr * cp * cy - cr * sp * sy,
    cr * sp * cy + sr * cp * sy,
    cr * cp * sy - sr * sp * cy,
  ];
}

/** Roll, pitch and yaw (rad) of a quaternion about the fixed axes X, Y and Z (REP-103): the inverse of quatOfRpy, exact at a pitch of
 *  ±90° too, where only the sum or difference of roll and yaw counts. The quaternion may have any length above 0. */
export function rpyOf([w, x, y, z]: Quat): Vec3 {
  const halfSum = Math.atan2(x + z, w - y);
  const halfDifference = Math.atan2(x - z, w + y);
  const pitch = 2 * Math.atan2(Math.hypot(w + y, x - z), Math.hypot(w - y, x + z)) - Math.PI / 2;
  return [wrapped(halfSum + halfDifference), pitch, wrapped(halfSum - halfDifference)];
}

/** The same direction within -π … π. */
function wrapped(angle: number): number {
  return Math.abs(angle) <= Math.PI ? angle : angle - Math.sign(angle) * 2 * Math.PI;
}

/** The same attitude, turned about the vertical to face along the world's x axis. The heading that is removed is the twist about
 *  z. It is undefined only upside down, in which case the attitude is returned unchanged. */
export function withoutHeading(worldFromBody: Quat): Quat {
  const [w, , , z] = worldFromBody;
  const twist = normalizeQuat([w, 0, 0, z]);
  return twist === null ? worldFromBody : multiplyQuats(invertQuat(twist), worldFromBody);
}

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
