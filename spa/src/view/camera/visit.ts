import type { EyePlace, Orbit } from './orbit.ts';
import { shorterTurn } from './orbit.ts';

/** A camera that a hand has turned (rad) or brought nearer (as a part of its distance) by less than this has not been moved: a
 *  mouse that clicks slips by a pixel or two. */
const SLIP = 0.03;

/** How the camera stood, and why it stood there. */
export interface Stance {
  readonly orbit: Orbit;
  /** Whether somebody had chosen the view. */
  readonly touched: boolean;
  /** Whether the distance was the one at which the robot fits. */
  readonly fitted: boolean;
  /** How much farther away the body kept the camera than when it was framed, as a factor. */
  readonly growth: number;
  /** A place that somebody's link had set; null for none. */
  readonly placed: EyePlace | null;
}

/** A look at a part of the robot, from which the camera can go back to where it stood before. */
export class Visit {
  #before: Stance;
  #there: Orbit;

  constructor(before: Stance, there: Orbit) {
    this.#before = before;
    this.#there = there;
  }

  /** Where the camera stood before. */
  get before(): Stance {
    return this.#before;
  }

  /** The robot has moved, and what the camera looked at, and looks at, with it. */
  move(moved: (orbit: Orbit) => Orbit): void {
    this.#before = { ...this.#before, orbit: moved(this.#before.orbit) };
    this.#there = moved(this.#there);
  }

  /** Whether a camera that stands so has stayed where the visit took it. */
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
