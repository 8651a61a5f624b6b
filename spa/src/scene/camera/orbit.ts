import { addScaled } from '../../model/vectors.ts';
import type { Vec3 } from '../../twin/rotation.ts';

/** Position and target of the camera, metres. */
export interface EyePlace {
  readonly position: Vec3;
  readonly target: Vec3;
}

/** A camera on a sphere around its target. */
export interface Orbit {
  /** Angle from the world's x axis towards its y axis, rad. */
  readonly azimuth: number;
  /** Angle above the horizon, rad. */
  readonly elevation: number;
  /** Metres. */
  readonly distance: number;
  readonly target: Vec3;
}

/** The camera position of an orbit, metres. */
export function positionOf({ azimuth, elevation, distance, target }: Orbit): Vec3 {
  const flat = Math.cos(elevation) * distance;
  return [
    target[0] + flat * Math.cos(azimuth),
    target[1] + flat * Math.sin(azimuth),
    target[2] + Math.sin(elevation) * distance,
  ];
}

/** The orbit of a camera at a place. */
export function orbitAt({ position, target }: EyePlace): Orbit {
  const [dx, dy, dz] = addScaled(position, target, -1);
  const flat = Math.hypot(dx, dy);
  return {
    azimuth: Math.atan2(dy, dx),
    elevation: Math.atan2(dz, flat),
    distance: Math.hypot(flat, dz),
    target,
  };
}

/** `value`, clamped to the bounds. */
export function clamp(value: number, least: number, most: number): number {
  return Math.min(most, Math.max(least, value));
}

/** The same rotation (rad) the shorter way round, −π…π. */
export function shorterTurn(angle: number): number {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}

/** The orbit at a fraction (0…1) of the way from one to another. */
export function between(from: Orbit, to: Orbit, part: number): Orbit {
  const mix = (a: number, b: number) => a + (b - a) * part;
  return {
    azimuth: mix(from.azimuth, to.azimuth),
    elevation: mix(from.elevation, to.elevation),
    distance: mix(from.distance, to.distance),
    target: addScaled(from.target, addScaled(to.target, from.target, -1), part),
  };
}

/** The orbit with its target moved to the right and down in the picture, metres. */
export function shifted(orbit: Orbit, right: number, down: number): Orbit {
  const { azimuth, elevation, target } = orbit;
  const se = Math.sin(elevation);
  const step: Vec3 = [
    -right * Math.sin(azimuth) + down * se * Math.cos(azimuth),
    right * Math.cos(azimuth) + down * se * Math.sin(azimuth),
    -down * Math.cos(elevation),
  ];
  return { ...orbit, target: addScaled(target, step) };
}
