/**
 * Where the eye stands to see a whole robot: shared by the camera and by the stick figure that is drawn before it, so that
 * nothing jumps when one takes the other's place. World: Z up, metres. Angles: degrees.
 */

import type { Extent } from '../model/bounds.ts';

export type ViewName = 'home' | 'front' | 'side' | 'top';

/** Vertical; long enough a lens that a robot keeps its proportions: Hubo fits from about 3 m. */
export const FIELD_OF_VIEW = 30;
/** Empty space around the robot, in heights and in widths: arms come out to the sides. */
const AIR_TALL = 1.22;
const AIR_WIDE = 1.3;

/** Where the eye stands, seen from what it looks at: azimuth from the robot's x (ahead) towards its y (left). */
export const VIEWS: Readonly<Record<ViewName, { azimuth: number; elevation: number }>> = {
  home: { azimuth: -45, elevation: 14 },
  front: { azimuth: 0, elevation: 4 },
  side: { azimuth: -90, elevation: 4 },
  // Not quite from above: there the screen's up would be undefined. Ahead is up.
  top: { azimuth: 180, elevation: 89.9 },
};

/** From how far the whole of it is in a picture of this aspect (width : height), also in an upright phone's. */
export function fittingDistance({ tall, wide, radius }: Extent, aspect: number): number {
  const slope = Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
  const byHeight = (tall * AIR_TALL) / slope;
  const byWidth = (wide * AIR_WIDE) / (slope * aspect);
  return Math.max(byHeight, byWidth, radius * 2) + wide / 2;
}
