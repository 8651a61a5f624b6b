/** Options that differ between renderers. */
export interface RigOptions {
  /** Minimum distance to the target, in radii of the robot; default `NEAREST`. */
  readonly nearest?: number;
  /** Maximum elevation of the camera, rad; default `HIGHEST`. */
  readonly highest?: number;
  /** Whether the viewer wants no motion, so that the camera jumps instead of easing. */
  readonly still?: () => boolean;
  /** Called when the camera has moved and a new picture is needed. */
  readonly changed?: () => void;
}

/** Default minimum distance of the camera from its target, in radii of the robot. */
export const NEAREST = 1 / 8;
/** Minimum elevation of the camera, rad: it stays above the floor, which has no underside. */
export const LOWEST = (0.5 * Math.PI) / 180;
/** Default maximum elevation, rad: straight from above, the picture's up would be undefined. */
export const HIGHEST = (89.9 * Math.PI) / 180;
