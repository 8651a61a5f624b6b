/** What the numbers of a state are, as far as it matters for what lies between two of them. All others are lengths or
 *  angles that do not wrap: between two of them is a straight line. */
export interface Layout {
  readonly size: number;
  /** Angles (rad) of joints that turn on and on: from 3 to -3 the way leads over π. */
  readonly wraps: ReadonlySet<number>;
  /** Where a unit quaternion w, x, y, z begins. */
  readonly quats: readonly number[];
}

const TURN = 2 * Math.PI;
/** Nearly the same orientation: a straight line is as good, and does not divide by nothing. */
const STRAIGHT = 0.9995;

/** into ← the state this part (0…1) of the way from one to the other. What one of them does not know is as in `to`. */
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

/** The same turn, in -π … π. */
export function shorterArc(angle: number): number {
  return angle - TURN * Math.round(angle / TURN);
}

/** Shoemake's spherical interpolation of the quaternion at `at`, the shorter way round: q and -q are one orientation. */
function slerp(from: Float64Array, to: Float64Array, part: number, into: Float64Array, at: number): void {
  let dot = 0;
  for (let i = at; i < at + 4; i += 1) dot += from[i]! * to[i]!;
  if (Number.isNaN(dot)) return; // one of them is not known: as `to`, above
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
