import type { Level } from '@posecast/wire';
import { addScaled, dot, normalize } from '../../../model/vectors.ts';
import type { Balance } from '../../../twin/balance/balance.ts';
import { fromEdge } from '../../../twin/balance/polygon.ts';
import type { Vec3 } from '../../../twin/rotation.ts';
import {
  type BalancePaints,
  drawDashes,
  drawLine,
  type Facets,
  faint,
  fillPolygon,
  fillRound,
  floorSpot,
} from './shapes.ts';

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
