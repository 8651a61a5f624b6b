import type { Level } from '@posecast/wire';
import { addScaled, cross, dot, normalize } from '../../model/vectors.ts';
import type { Balance, FootBalance } from '../../twin/balance/balance.ts';
import { fromEdge } from '../../twin/balance/polygon.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import {
  type BalancePaints,
  drawBall,
  drawDashes,
  drawLine,
  drawRod,
  faint,
  fillPolygon,
  fillQuarters,
  fillRing,
  fillRound,
  floorSpot,
} from './balance_shapes.ts';
import type { Facets } from './strokes.ts';

/** Sizes in radii of the robot. */
const OUTLINE = 0.009;
const EDGE = 0.016;
/** The width of an edge that is near or passed, between dark borders that distinguish it without colour. */
const WARNING = 0.03;
const BORDER = 0.007;
const MARGIN = 0.005;
const DASH = 0.025;
const MARK = 0.05;
/** The area around the projected centre of mass that is covered by the marks of mass and pressure. */
const CLEAR = 0.075;
const FILL = 0.28;
/** For a polygon that is only assumed. */
const ASSUMED_FILL = 0.16;

/** Where the margin is measured: from the projected centre of mass to the nearest edge. */
export interface MarginLine {
  readonly foot: Vec3;
  readonly edge: Vec3;
  readonly ends: readonly [Vec3, Vec3];
}

/** Draws the support polygon, and its edge nearest to the mass. `z`: the height to draw at, m. Returns the middle of its level
 *  sign, if it has one. */
export function drawSupport(
  facets: Facets,
  { polygon, ground }: Balance,
  margin: MarginLine | null,
  level: Level,
  z: number,
  reach: number,
  paints: BalancePaints,
): Vec3 | undefined {
  if (polygon.length < 3) return;
  const corners = polygon.map(([x, y]): Vec3 => [x, y, z]);
  const assumed = ground === 'lowest';
  const inside = level === 'fault' ? paints.margin : paints.support;
  fillPolygon(facets, corners, faint(inside, assumed ? ASSUMED_FILL : FILL));
  if (assumed) drawDashes(facets, corners, OUTLINE * reach, DASH * reach, faint(paints.support, 0.8));
  else drawLine(facets, corners, OUTLINE * reach, faint(paints.support, 0.85), { closed: true });
  if (margin === null) return;
  if (level !== 'ok') drawLine(facets, margin.ends, (WARNING + 2 * BORDER) * reach, paints.black);
  drawLine(facets, margin.ends, (level === 'ok' ? EDGE : WARNING) * reach, paints.margin);
  drawLine(facets, [margin.foot, margin.edge], MARGIN * reach, paints.margin);
  return drawLevel(facets, margin, level, reach, paints);
}

/** Draws the level sign beside the nearest edge, so that colour is not the only cue: for a caution, a triangle that points in the
 *  direction of a fall; for a fault, an octagon; otherwise nothing. */
function drawLevel(
  facets: Facets,
  { foot, edge, ends: [from, to] }: MarginLine,
  level: Level,
  reach: number,
  { margin, black }: BalancePaints,
): Vec3 | undefined {
  if (level === 'ok') return;
  const along = normalize(addScaled(to, from, -1));
  const outward: Vec3 = [along[1], -along[0], 0]; // the polygon is counter-clockwise
  const size = MARK * reach;
  const [corners, before] = level === 'caution' ? [3, 0.95] : [8, 1.4];
  const hidden = CLEAR * reach - dot(addScaled(edge, foot, -1), outward);
  const away = Math.max(0, hidden) + size * before;
  const spot = floorSpot(addScaled(edge, outward, away), outward);
  fillRound(facets, spot, size * 1.16, black, corners);
  fillRound(facets, spot, size, margin, corners);
  return spot.at;
}

/** The shortest line from the projected centre of mass to the nearest edge, at height `z`; null while there is no margin. */
export function marginLine(balance: Balance, z: number): MarginLine | null {
  const { polygon, nearestEdge, centreOfMass, marginM } = balance;
  if (nearestEdge === null || centreOfMass === null || marginM === null) return null;
  const corner = (i: number): Vec3 => {
    const [x, y] = polygon[i % polygon.length]!;
    return [x, y, z];
  };
  const ends = [corner(nearestEdge), corner(nearestEdge + 1)] as const;
  const foot: Vec3 = [centreOfMass[0], centreOfMass[1], z];
  return { foot, edge: addScaled(foot, fromEdge<Vec3>(...ends, foot), -1), ends };
}

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
