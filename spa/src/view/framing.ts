/**
 * Where the camera stands to see a whole robot. Shared by the camera and the stick figure that is drawn first, so that
 * nothing jumps when the scene replaces the stick figure. World: Z up, metres. Angles: degrees.
 */

import type { Extent } from '../model/bounds.ts';

export type ViewName = 'home' | 'front' | 'side' | 'top';

/** Vertical field of view, degrees. It is narrow, so that perspective hardly distorts a robot. */
export const FIELD_OF_VIEW = 30;
/** Height and width of the picture relative to the robot's: it leaves room for arms that move to the sides. */
const AIR_TALL = 1.22;
const AIR_WIDE = 1.3;

/** Directions from the target to the camera: azimuth from x (ahead) towards y (left), elevation above the horizon. */
export const VIEWS: Readonly<Record<ViewName, { azimuth: number; elevation: number }>> = {
  home: { azimuth: -45, elevation: 14 },
  front: { azimuth: 0, elevation: 4 },
  side: { azimuth: -90, elevation: 4 },
  // Not exactly from above, where the picture's up would be undefined. Ahead is up.
  top: { azimuth: 180, elevation: 89.9 },
};

/** The distance (metres) from which the whole extent fits a picture of this aspect (width : height). */
export function fittingDistance({ tall, wide, radius }: Extent, aspect: number): number {
  const slope = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
  const byHeight = (tall * AIR_TALL) / slope;
  const byWidth = (wide * AIR_WIDE) / (slope * aspect);
  return Math.max(byHeight, byWidth, radius * 2) + wide / 2;
}
