import type { EyePlace, Orbit } from './orbit.ts';
import { shorterTurn } from './orbit.ts';

/** A camera that was rotated (rad) or moved closer (as a fraction of its distance) by less than this does not count as moved: a
 *  clicking mouse slips by a pixel or two. */
const SLIP = 0.03;

/** The camera's position, and the reason for it. */
export interface Stance {
  readonly orbit: Orbit;
  /** Whether the viewer had chosen the view. */
  readonly touched: boolean;
  /** Whether the distance was the one that fits the robot. */
  readonly fitted: boolean;
  /** The factor by which the body kept the camera farther away than when it was framed. */
  readonly growth: number;
  /** A place set by a link; null for none. */
  readonly placed: EyePlace | null;
}

/** A close view of a part of the robot, from which the camera can return to its previous position. */
export class Visit {
  #before: Stance;
  #there: Orbit;

  constructor(before: Stance, there: Orbit) {
    this.#before = before;
    this.#there = there;
  }

  /** The camera's previous position. */
  get before(): Stance {
    return this.#before;
  }

  /** The robot has moved, and the camera's previous and current targets with it. */
  move(moved: (orbit: Orbit) => Orbit): void {
    this.#before = { ...this.#before, orbit: moved(this.#before.orbit) };
    this.#there = moved(this.#there);
  }

  /** Whether a camera in this position is still where the visit took it. */
  holds({ azimuth, elevation, distance, target }: Orbit): boolean {
    const there = this.#there;
    const off = Math.hypot(...target.map((metres, axis) => metres - there.target[axis]!));
    return [
      shorterTurn(azimuth - there.azimuth),
      elevation - there.elevation,
      distance / there.distance - 1,
      off / there.distance,
    ].every((part) => Math.abs(part) < SLIP);
  }
}
