import type { Vec3 } from '../rotation.ts';
import type { FootState, Triple } from './foot_state.ts';

/** The time constant of the velocity's filter, seconds. */
export const SMOOTHED_S = 0.1;
/** Over a longer gap between two poses nothing is known of the way between them. */
export const GAP_S = 0.5;

/** Whether a pose goes on from one before (times in seconds; NaN: there was none). */
export function follows(beforeS: number, nowS: number): boolean {
  return nowS >= beforeS && nowS - beforeS <= GAP_S;
}

/** Where a foot was. */
interface Stood {
  bore: boolean;
  readonly centre: Triple;
  /** As `FootState.rows`. */
  readonly rows: Float64Array;
}

/**
 * The velocity of the centre of mass, from differences of successive poses.
 *
 * It is relative to a foot that bears weight in both poses, the one with the greatest force now, else the first: such a
 * foot neither slides nor turns about the vertical, whereas odometry drifts. The differences are smoothed by a low-pass
 * filter of first order with a time constant of 0.1 s: what is told lies 0.1 s and half the time between two poses
 * behind. It begins anew after more than 0.5 s without a pose, when time runs back, and when no foot bears in both poses.
 */
export class CentreVelocity {
  /** m/s in the world; null while it is not known. */
  value: Vec3 | null = null;
  readonly #velocity: Triple = [0, 0, 0];
  readonly #feet: readonly FootState[];
  readonly #stood: readonly Stood[];
  readonly #centre: Triple = [0, 0, 0];
  /** NaN before the first pose. */
  #tS = Number.NaN;
  #known = false;

  constructor(feet: readonly FootState[]) {
    this.#feet = feet;
    this.#stood = feet.map(() => ({ bore: false, centre: [0, 0, 0], rows: new Float64Array(6) }));
  }

  /** Takes the centre of mass (world, metres) and the feet of a pose. The centre is null while it is not known, and
   *  `unread` true while it is not known which feet bear: then the velocity is not known either, and what came before is
   *  kept for the next pose. */
  update(tS: number, centre: Vec3 | null, unread: boolean): void {
    if (!follows(this.#tS, tS)) this.#forget();
    if (centre === null || unread) {
      this.value = null;
      return;
    }
    const passed = tS - this.#tS;
    if (passed === 0) {
      this.value = this.#known ? this.#velocity : null;
      return;
    }
    const shared = Number.isNaN(this.#tS) ? -1 : this.#sharedFoot();
    if (shared < 0) this.#known = false;
    else this.#smooth(centre, this.#feet[shared]!, this.#stood[shared]!, passed);
    this.value = this.#known ? this.#velocity : null;
    this.#remember(tS, centre);
  }

  #smooth(centre: Vec3, now: FootState, before: Stood, passed: number): void {
    // The rotation about the vertical that the foot seems to have made: the twist of now_from_before.
    const ahead = inner(now.rows, 0, before.rows, 0) + inner(now.rows, 3, before.rows, 3);
    const aside = inner(now.rows, 3, before.rows, 0) - inner(now.rows, 0, before.rows, 3);
    const length = Math.hypot(ahead, aside);
    const [cos, sin] = length > 0 ? [ahead / length, aside / length] : [1, 0];
    const x = this.#centre[0] - before.centre[0];
    const y = this.#centre[1] - before.centre[1];
    const vx = (centre[0] - now.centre[0] - (cos * x - sin * y)) / passed;
    const vy = (centre[1] - now.centre[1] - (sin * x + cos * y)) / passed;
    const vz = (centre[2] - now.centre[2] - (this.#centre[2] - before.centre[2])) / passed;
    const v = this.#velocity;
    const share = this.#known ? -Math.expm1(-passed / SMOOTHED_S) : 1;
    const [ox, oy] = this.#known ? [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1]] : [vx, vy];
    v[0] = ox + share * (vx - ox);
    v[1] = oy + share * (vy - oy);
    v[2] = this.#known ? v[2] + share * (vz - v[2]) : vz;
    this.#known = true;
  }

  /** The foot that bears now and bore before: the one with the greatest force, else the first; -1 for none. */
  #sharedFoot(): number {
    let best = -1;
    for (let i = 0; i < this.#feet.length; i += 1) {
      if (this.#feet[i]!.bears !== true || !this.#stood[i]!.bore) continue;
      if (best < 0 || (this.#feet[i]!.forceN ?? 0) > (this.#feet[best]!.forceN ?? 0)) best = i;
    }
    return best;
  }

  #remember(tS: number, centre: Vec3): void {
    this.#tS = tS;
    for (let axis = 0; axis < 3; axis += 1) this.#centre[axis] = centre[axis]!;
    for (let i = 0; i < this.#feet.length; i += 1) {
      const [foot, stood] = [this.#feet[i]!, this.#stood[i]!];
      stood.bore = foot.bears === true;
      for (let axis = 0; axis < 3; axis += 1) stood.centre[axis] = foot.centre[axis]!;
      stood.rows.set(foot.rows);
    }
  }

  #forget(): void {
    this.#tS = Number.NaN;
    this.#known = false;
  }
}

/** The inner product of three numbers of one array and three of another. */
function inner(a: Float64Array, at: number, b: Float64Array, bt: number): number {
  return a[at]! * b[bt]! + a[at + 1]! * b[bt + 1]! + a[at + 2]! * b[bt + 2]!;
}
