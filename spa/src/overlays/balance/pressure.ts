import { addScaled, cross, normalize, rejectFrom } from '../../model/vectors.ts';
import type { Balance, FootBalance } from '../../twin/balance/balance.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import type { Facets } from './facets.ts';
import type { BalancePaints } from './paints.ts';
import { drawLine, fillRing, fillRound, floorSpot, type Spot } from './shapes.ts';
import { nearestOn } from './support.ts';

/** Sizes in radii of the robot. */
const FOOT_DISC = 0.019;
const RIM = 0.005;
/** Of the mark of all feet: a hoop that the mass' foot lies in while the robot is at rest. */
const INNER = 0.06;
const OUTER = 0.073;
const BAR = 0.045;
const BAR_WIDE = 0.014;

/** Draws where the floor pushes against each foot (a disc), and against all of them (a hoop). */
export function drawPressure(
  facets: Facets,
  { feet, pressure }: Balance,
  z: number,
  lift: number,
  reach: number,
  paints: BalancePaints,
): void {
  if (pressure !== null) {
    const [x, y] = pressure;
    fillRing(facets, floorSpot([x, y, z]), INNER * reach, OUTER * reach, paints.pressure);
  }
  for (const foot of feet)
    if (foot.pressure !== null) drawFoot(facets, foot, foot.pressure, lift, reach, paints);
}

function drawFoot(
  facets: Facets,
  { corners, atEdge }: FootBalance,
  pressure: Vec3,
  lift: number,
  reach: number,
  { pressure: green, tipping, black }: BalancePaints,
): void {
  const { axis, ahead } = soleSpot(corners);
  const spot: Spot = { at: addScaled(pressure, axis, lift), axis, ahead };
  const paint = atEdge ? tipping : green;
  fillRound(facets, spot, FOOT_DISC * reach, paint);
  fillRing(facets, spot, FOOT_DISC * reach, (FOOT_DISC + RIM) * reach, black);
  if (atEdge) drawBar(facets, corners, pressure, axis, lift, reach, tipping);
}

/** Draws a bar along the sole's edge that the pressure has come to: about it the foot would tip. */
function drawBar(
  facets: Facets,
  corners: readonly Vec3[],
  pressure: Vec3,
  axis: Vec3,
  lift: number,
  reach: number,
  paint: BalancePaints['tipping'],
): void {
  const edges = corners.map((from, i) => [from, corners[(i + 1) % corners.length]!] as const);
  const far = (edge: readonly [Vec3, Vec3]) =>
    Math.hypot(...addScaled(nearestOn(edge, pressure), pressure, -1));
  const edge = edges.reduce((best, next) => (far(next) < far(best) ? next : best));
  const along = normalize(addScaled(edge[1], edge[0], -1));
  const outward = cross(along, axis);
  const at = addScaled(addScaled(nearestOn(edge, pressure), axis, lift), outward, (BAR_WIDE / 2) * reach);
  const ends = [addScaled(at, along, -BAR * reach), addScaled(at, along, BAR * reach)];
  drawLine(facets, ends, BAR_WIDE * reach, paint, { normal: axis });
}

/** A sole's normal, and a direction in it. */
function soleSpot(corners: readonly Vec3[]): Omit<Spot, 'at'> {
  const [first, second, third] = corners;
  if (first === undefined || second === undefined || third === undefined)
    return { axis: [0, 0, 1], ahead: [1, 0, 0] };
  const ahead = normalize(addScaled(second, first, -1));
  const axis = normalize(cross(ahead, rejectFrom(addScaled(third, second, -1), ahead)));
  return { axis, ahead };
}
