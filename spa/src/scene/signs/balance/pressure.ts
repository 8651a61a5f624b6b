import { addScaled, cross, normalize } from '../../../model/vectors.ts';
import type { Balance, FootBalance } from '../../../twin/balance/balance.ts';
import { fromEdge } from '../../../twin/balance/margin.ts';
import type { Vec3 } from '../../../twin/rotation.ts';
import type { Facets } from './facets.ts';
import type { BalancePaints } from './paints.ts';
import { drawLine, fillRing, fillRound, floorSpot } from './shapes.ts';

/** Sizes in radii of the robot. */
const FOOT_DISC = 0.019;
const RIM = 0.005;
/** For the combined mark of all feet: a ring around the projected centre of mass while the robot is at rest. */
const INNER = 0.06;
const OUTER = 0.073;
const BAR = 0.045;
const BAR_WIDE = 0.014;

/** Draws the centre of pressure of each foot (a disc), and of all feet together (a ring). */
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
  { corners, normal: axis, atEdge }: FootBalance,
  pressure: Vec3,
  lift: number,
  reach: number,
  { pressure: green, tipping, black }: BalancePaints,
): void {
  const ahead = normalize(addScaled(corners[1]!, corners[0]!, -1));
  const spot = { at: addScaled(pressure, axis, lift), axis, ahead };
  const paint = atEdge ? tipping : green;
  fillRound(facets, spot, FOOT_DISC * reach, paint);
  fillRing(facets, spot, FOOT_DISC * reach, (FOOT_DISC + RIM) * reach, black);
  if (atEdge) drawBar(facets, corners, pressure, axis, lift, reach, tipping);
}

/** Draws a bar along the sole's edge that the pressure has reached: the foot would tip over this edge. */
function drawBar(
  facets: Facets,
  corners: readonly Vec3[],
  pressure: Vec3,
  axis: Vec3,
  lift: number,
  reach: number,
  paint: BalancePaints['tipping'],
): void {
  const edges = corners.map((from, i) => {
    const to = corners[(i + 1) % corners.length]!;
    const away = fromEdge(from, to, pressure);
    return { along: normalize(addScaled(to, from, -1)), away, far: Math.hypot(...away) };
  });
  const { along, away } = edges.reduce((best, next) => (next.far < best.far ? next : best));
  const outward = cross(along, axis);
  const on = addScaled(addScaled(pressure, away, -1), axis, lift);
  const at = addScaled(on, outward, (BAR_WIDE / 2) * reach);
  const ends = [addScaled(at, along, -BAR * reach), addScaled(at, along, BAR * reach)];
  drawLine(facets, ends, BAR_WIDE * reach, paint, { normal: axis });
}
