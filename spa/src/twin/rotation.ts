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
  const about = (angle: number, axis: 1 | 2 | 3): Quat => {
    const q: [number, number, number, number] = [Math.cos(angle / 2), 0, 0, 0];
    q[axis] = Math.sin(angle / 2);
    return q;
  };
  return multiplyQuats(about(yaw, 3), multiplyQuats(about(pitch, 2), about(roll, 1)));
}

/** Roll, pitch and yaw (rad) of a unit quaternion about the fixed axes X, Y and Z (REP-103). */
export function rpyOf([w, x, y, z]: Quat): Vec3 {
  const sine = Math.max(-1, Math.min(1, 2 * (w * y - z * x)));
  return [
    Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    Math.asin(sine),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  ];
}

/** The same attitude, turned about the vertical to face along the world's x axis. The heading that is removed is the twist about
 *  z. It is undefined only upside down, in which case the attitude is returned unchanged. */
export function withoutHeading(worldFromBody: Quat): Quat {
  const [w, , , z] = worldFromBody;
  const twist = normalizeQuat([w, 0, 0, z]);
  return twist === null ? worldFromBody : multiplyQuats(invertQuat(twist), worldFromBody);
}
