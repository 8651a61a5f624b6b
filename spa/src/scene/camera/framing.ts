/**
 * The camera position for seeing a whole robot. Shared by the camera and the initial stick figure, so that nothing jumps when the
 * scene replaces the stick figure. World: Z up, metres. Angles: degrees.
 */

import type { Extent } from '../../model/bounds.ts';

export type ViewName = 'home' | 'front' | 'side' | 'top';

/** Vertical field of view, degrees. It is narrow, so that perspective hardly distorts a robot. */
export const FIELD_OF_VIEW = 30;
/** How much of the picture a framed robot fills: the rest is for arms that move, and for its steps. A low picture, as on a phone, has
 *  none to spare: there the camera moves away when the robot needs it. */
interface Filling {
  /** The height of such a picture, CSS px. */
  readonly px: number;
  /** Height of the picture relative to the robot's. */
  readonly air: number;
  /** Fraction of the picture's height and width for the cylinder around the robot. */
  readonly fills: number;
}
const LOW: Filling = { px: 340, air: 1.05, fills: 0.985 };
const HIGH: Filling = { px: 520, air: 1.22, fills: 0.88 };
/** Width of the picture relative to the robot's. */
const AIR_WIDE = 1.3;

/** The filling of a picture of this height, CSS px. */
function fillingAt(heightPx: number): Filling {
  const part = Math.min(1, Math.max(0, (heightPx - LOW.px) / (HIGH.px - LOW.px)));
  const between = (key: keyof Filling) => LOW[key] + (HIGH[key] - LOW[key]) * part;
  return { px: heightPx, air: between('air'), fills: between('fills') };
}

/** Directions from the target to the camera: azimuth from x (ahead) towards y (left), elevation above the horizon. */
export const VIEWS: Readonly<Record<ViewName, { azimuth: number; elevation: number }>> = {
  home: { azimuth: -45, elevation: 14 },
  front: { azimuth: 0, elevation: 4 },
  side: { azimuth: -90, elevation: 4 },
  // Not exactly from above, where the picture's up would be undefined. The robot's front points up.
  top: { azimuth: 180, elevation: 89.9 },
};

/** The initial view of a body that lies along an axis: nearly perpendicular to its length. */
const HOME_OF_LONG = { x: { azimuth: -75, elevation: 14 }, y: { azimuth: -15, elevation: 14 } } as const;

/** The direction of a named view of a body of this extent. */
export function directionOf(view: ViewName, { lies }: Extent): { azimuth: number; elevation: number } {
  return view === 'home' && lies !== undefined ? HOME_OF_LONG[lies] : VIEWS[view];
}

/** Fraction of the picture's height and width that the cylinder around a robot may fill while it moves. */
const FILLS_MOVING = 0.985;
/** The elevation for which that room is computed. From lower elevations, there is more. */
const TILT = (VIEWS.home.elevation * Math.PI) / 180;
const SLOPE = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);

/** The distance (metres) from which the whole extent fits a picture of this aspect (width : height); in a picture that is low in CSS
 *  px, it is nearer. A long body needs no room at its sides, because it does not get longer. */
export function fittingDistance(
  { tall, wide, radius, lies }: Extent,
  aspect: number,
  heightPx = HIGH.px,
): number {
  const { air, fills } = fillingAt(heightPx);
  const least = leastDistance(tall, wide, aspect, fills);
  if (lies !== undefined) return least;
  const byHeight = (tall * air) / SLOPE;
  const byWidth = (wide * AIR_WIDE) / (SLOPE * aspect);
  return Math.max(Math.max(byHeight, byWidth, radius * 2) + wide / 2, least);
}

/** The minimum distance (metres) at which an upright cylinder of this half height and radius (metres) fits the picture, if its
 *  middle is the target. */
export function leastDistance(half: number, radius: number, aspect: number, fills = FILLS_MOVING): number {
  const [slope, side] = [SLOPE * fills, SLOPE * aspect * fills];
  const [se, ce] = [Math.sin(TILT), Math.cos(TILT)];
  // The lowest point of its near side, and the point where a line of sight touches its upper end.
  const byHeight = (half * (ce - slope * se) + radius * (se + slope * ce)) / slope;
  const byWidth = half * se + radius * Math.hypot(1, 1 / side);
  return Math.max(byHeight, byWidth);
}

/** For this distance: the half height of a cylinder with this radius that fits the picture, and the radius of one with this half
 *  height. All metres. */
export function roomAt(
  distance: number,
  { half, radius }: { readonly half: number; readonly radius: number },
  aspect: number,
): { readonly half: number; readonly radius: number } {
  const [slope, side] = [SLOPE * FILLS_MOVING, SLOPE * aspect * FILLS_MOVING];
  const [se, ce] = [Math.sin(TILT), Math.cos(TILT)];
  return {
    half: (slope * distance - radius * (se + slope * ce)) / (ce - slope * se),
    radius: Math.min(
      (distance - half * se) / Math.hypot(1, 1 / side),
      (slope * distance - half * (ce - slope * se)) / (se + slope * ce),
    ),
  };
}

/** The length (metres) over which the floor's light and lines fade around a robot of this radius at this height: from high up,
 *  the floor is visible only far away. */
export function fadeOf(reach: number, flies: number): number {
  return reach + flies / 2;
}
