import type { LinkBox } from '../../model/bounds.ts';
import type { PlacedBox } from '../../model/posed_body.ts';
import { addScaled, dot } from '../../model/vectors.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import { clamp, type Orbit } from './orbit.ts';

const RADIANS = Math.PI / 180;
/** Candidate rotations from the current direction, and elevations in addition to the current one; rad. */
const TURNS = [0, 30, -30, 60, -60, 90, -90, 120, -120, 150, -150, 180].map((turn) => turn * RADIANS);
const ELEVATIONS = [5, 30, 55].map((elevation) => elevation * RADIANS);
/** A line of sight may pass through boxes for this length and still count as free. A direction counts as equal to the best one if
 *  its line of sight through boxes is longer by no more than this. In radii of the robot: boxes are larger than the meshes in
 *  them. */
const TOLERANCE = 0.03;
/** Around a joint, this much of a box that contains it is its housing, which hides nothing important. In radii of the robot. */
const HOUSING = 0.1;

/** The viewpoint for a point. */
export interface Sight {
  /** The camera's current position, and its future distance from the point. */
  readonly from: Pick<Orbit, 'azimuth' | 'elevation' | 'distance'>;
  /** The radius of the robot, metres. */
  readonly reach: number;
  /** The minimum and maximum elevation, rad. */
  readonly lowest: number;
  readonly highest: number;
}

/**
 * The direction (rad) nearest to the camera's current one from which these boxes do not hide a point of the world; if it is
 * hidden from everywhere, one from which it is hidden least. At most 48 lines of sight are tested, each against every box.
 */
export function clearDirection(
  point: Vec3,
  hiding: Iterable<PlacedBox>,
  { from, reach, lowest, highest }: Sight,
): Pick<Orbit, 'azimuth' | 'elevation'> {
  const boxes = [...hiding].map((placed) => obstacleOf(placed, point));
  const coverTo = (to: Vec3) =>
    boxes.reduce((sum, box) => sum + lengthInside(box, to, from.distance, reach * HOUSING), 0);
  const now = unitTo(from);
  if (coverTo(now) <= TOLERANCE * reach) return from;
  const elevations = [from.elevation, ...ELEVATIONS].map((angle) => clamp(angle, lowest, highest));
  const candidates = elevations.flatMap((elevation) =>
    TURNS.map((turn) => {
      const way = { azimuth: from.azimuth + turn, elevation };
      const to = unitTo(way);
      return { way, cover: coverTo(to), near: dot(to, now) };
    }),
  );
  const least = Math.min(...candidates.map(({ cover }) => cover));
  const clear = candidates.filter(({ cover }) => cover <= least + TOLERANCE * reach);
  return clear.reduce((best, other) => (other.near > best.near ? other : best)).way;
}

/** A box as seen from a point: in the link's frame, where it is axis-aligned. */
interface Obstacle {
  readonly box: LinkBox;
  /** The axes of the link's frame, in the world. */
  readonly axes: readonly Vec3[];
  /** The point, in the link's frame. */
  readonly point: Vec3;
  /** Whether the point is inside. */
  readonly holds: boolean;
}

function obstacleOf([{ matrixWorld }, box]: PlacedBox, at: Vec3): Obstacle {
  const m = matrixWorld.elements;
  const axes = [0, 4, 8].map((i): Vec3 => [m[i]!, m[i + 1]!, m[i + 2]!]);
  const off = addScaled(at, [m[12]!, m[13]!, m[14]!], -1);
  const point: Vec3 = [dot(axes[0]!, off), dot(axes[1]!, off), dot(axes[2]!, off)];
  const holds = point.every((value, axis) => value >= box.min[axis]! && value <= box.max[axis]!);
  return { box, axes, point, holds };
}

/** The length (metres) of the path from the point along a unit vector inside the box, minus its `housing` around a point
 *  inside. */
function lengthInside(
  { box, axes, point, holds }: Obstacle,
  to: Vec3,
  distance: number,
  housing: number,
): number {
  let enters = 0;
  let leaves = distance;
  for (let axis = 0; axis < 3; axis += 1) {
    const speed = dot(axes[axis]!, to);
    const [low, high] = [box.min[axis]! - point[axis]!, box.max[axis]! - point[axis]!];
    if (Math.abs(speed) < 1e-9) {
      if (low > 0 || high < 0) return 0;
      continue;
    }
    enters = Math.max(enters, Math.min(low / speed, high / speed));
    leaves = Math.min(leaves, Math.max(low / speed, high / speed));
  }
  const hidden = leaves - enters - (holds ? housing : 0);
  return Math.max(0, hidden || 0); // a box without a finite position hides nothing
}

function unitTo({ azimuth, elevation }: Pick<Orbit, 'azimuth' | 'elevation'>): Vec3 {
  const flat = Math.cos(elevation);
  return [flat * Math.cos(azimuth), flat * Math.sin(azimuth), Math.sin(elevation)];
}
