import type { Balance, Vec2 } from './balance.ts';
import { fromEdge } from './margin.ts';

/** A direction from the robot's own point of view. */
export type Side = 'forwards' | 'backwards' | 'left' | 'right';

/** A different direction is named only if it dominates by this factor: near 45° it would flicker. */
const CLEARLY = 1.25;

/** The direction in which a robot would fall if its centre of mass is outside its support: from the nearest point of the edge to
 *  the centre of mass. `before`: the previous result. null if there is no edge. */
export function fallDirection(
  { centreOfMass, polygon, nearestEdge }: Pick<Balance, 'centreOfMass' | 'polygon' | 'nearestEdge'>,
  headingRad: number,
  before: Side | null,
): Side | null {
  const from = nearestEdge === null ? undefined : polygon[nearestEdge];
  if (centreOfMass === null || from === undefined) return null;
  const to = polygon[(nearestEdge! + 1) % polygon.length]!;
  const [x, y] = fromEdge<Vec2>(from, to, [centreOfMass[0], centreOfMass[1]]);
  const [cos, sin] = [Math.cos(headingRad), Math.sin(headingRad)];
  const ahead = x * cos + y * sin;
  const left = y * cos - x * sin;
  const along: Side = ahead >= 0 ? 'forwards' : 'backwards';
  const across: Side = left >= 0 ? 'left' : 'right';
  const held = before === along ? CLEARLY : before === across ? 1 / CLEARLY : 1;
  return Math.abs(ahead) * held >= Math.abs(left) ? along : across;
}
