import { addScaled } from '../../../model/vectors.ts';
import type { Vec3 } from '../../../twin/rotation.ts';
import type { Facets } from './facets.ts';
import { type BalancePaints, faint } from './paints.ts';
import { drawBall, drawLine, drawRod, fillQuarters, fillRing, floorSpot } from './shapes.ts';

/** Sizes in radii of the robot. */
const BALL = 0.064;
const PLUMB = 0.0045;
const FOOT = 0.04;
const FOOT_RIM = 0.007;
const CAPTURE = 0.04;
const CAPTURE_RIM = 0.011;
const CAPTURE_LINE = 0.004;

/** Draws the centre of mass projected onto the floor: quarters as on the ball. */
export function drawMassFoot(
  facets: Facets,
  foot: Vec3,
  ahead: Vec3,
  reach: number,
  paints: BalancePaints,
): void {
  const spot = floorSpot(foot, ahead);
  const radius = FOOT * reach;
  fillQuarters(facets, spot, radius, paints.white, paints.black);
  fillRing(facets, spot, radius, radius + FOOT_RIM * reach, paints.margin);
}

/** Draws the ball at the centre of mass, and its plumb line down to the floor. */
export function drawMass(
  facets: Facets,
  centre: Vec3,
  foot: Vec3 | null,
  ahead: Vec3,
  reach: number,
  paints: BalancePaints,
): void {
  if (foot !== null) drawRod(facets, foot, centre, PLUMB * reach, faint(paints.mass, 0.9));
  drawBall(
    facets,
    centre,
    BALL * reach,
    Math.atan2(ahead[1], ahead[0]),
    paints.white,
    paints.black,
    paints.margin === paints.support ? paints.mass : paints.margin,
  );
}

/** Draws the capture point: a hollow square at the end of a line from the projected centre of mass. Nothing while it lies within
 *  the mark of that point, because the robot is then at rest. */
export function drawCapture(
  facets: Facets,
  foot: Vec3,
  [x, y]: Vec3,
  ahead: Vec3,
  reach: number,
  { mass }: BalancePaints,
): boolean {
  const at: Vec3 = [x, y, foot[2]];
  const way = addScaled(at, foot, -1);
  const away = Math.hypot(...way);
  if (away <= (FOOT + FOOT_RIM) * reach) return false;
  const size = CAPTURE * reach;
  const from = addScaled(foot, way, ((FOOT + FOOT_RIM) * reach) / away);
  const to = addScaled(foot, way, Math.max(0, away - size * 0.7) / away);
  if (away > (FOOT + FOOT_RIM) * reach + size * 0.7)
    drawLine(facets, [from, to], CAPTURE_LINE * reach, faint(mass, 0.8));
  fillRing(facets, floorSpot(at, ahead), size - CAPTURE_RIM * reach, size, mass, 2 * Math.PI, 4);
  return true;
}
