/** How the numbers of a state are interpolated: wrapping angles and quaternions are listed here; all others are lengths or angles
 *  with linear interpolation. */
export interface Layout {
  readonly size: number;
  /** Indices of angles (rad) of continuous joints, which wrap: from 3 to -3 the way leads over π. */
  readonly wraps: ReadonlySet<number>;
  /** Indices at which a unit quaternion w, x, y, z begins. */
  readonly quats: readonly number[];
}

const TURN = 2 * Math.PI;
/** Above this cosine the orientations are nearly equal: linear interpolation is as good and avoids a division by zero.
 *  */
const STRAIGHT = 0.9995;

/** Writes to `into` the state at `part` (0…1) of the way from `from` to `to`. A value that is NaN in either is taken
 *  from `to`. */
export function blend(
  { wraps, quats }: Layout,
  from: Float64Array,
  to: Float64Array,
  part: number,
  into: Float64Array,
): void {
  for (let i = 0; i < to.length; i += 1) {
    const a = from[i]!;
    const b = to[i]!;
    if (Number.isNaN(a) || Number.isNaN(b)) into[i] = b;
    else if (wraps.has(i)) into[i] = a + shorterArc(b - a) * part;
    else into[i] = a + (b - a) * part;
  }
  for (const at of quats) slerp(from, to, part, into, at);
}

/** The equivalent angle in -π … π, rad. */
export function shorterArc(angle: number): number {
  return angle - TURN * Math.round(angle / TURN);
}

/** Shoemake's spherical interpolation of the quaternion at `at`, the shorter way round: q and -q are one orientation. */
function slerp(from: Float64Array, to: Float64Array, part: number, into: Float64Array, at: number): void {
  let dot = 0;
  for (let i = at; i < at + 4; i += 1) dot += from[i]! * to[i]!;
  if (Number.isNaN(dot)) return; // one of them is unknown: take `to`, as above
  const way = dot < 0 ? -1 : 1;
  const cosine = Math.min(1, dot * way);
  let a = 1 - part;
  let b = part;
  if (cosine < STRAIGHT) {
    const angle = Math.acos(cosine);
    const sine = Math.sin(angle);
    a = Math.sin(a * angle) / sine;
    b = Math.sin(b * angle) / sine;
  }
  let length = 0;
  for (let i = at; i < at + 4; i += 1) {
    const value = a * from[i]! + b * way * to[i]!;
    into[i] = value;
    length += value * value;
  }
  length = Math.sqrt(length);
  for (let i = at; i < at + 4; i += 1) into[i] = into[i]! / length;
}
