import { addScaled, dot, rotateAbout, scale, type Vec3 } from '../rotation.ts';
import type { Slide } from './balance.ts';
import type { FootState } from './foot_state.ts';

/** The time constant of the velocity's filter, seconds. */
export const SMOOTHED_S = 0.1;
/** Across a longer gap between two poses, the velocity is unknown. A robot at rest sends a frame at its first sample after 0.5 s,
 *  so with a gap of 0.5 s it would never have a velocity. */
export const GAP_S = 0.75;

const UP: Vec3 = [0, 0, 1];

/** Whether a pose continues from an earlier one (times in seconds; NaN: there was none). */
export function follows(beforeS: number, nowS: number): boolean {
  return nowS >= beforeS && nowS - beforeS <= GAP_S;
}

/** The earlier place of a foot. */
type Stood = Pick<FootState, 'bears' | 'centre' | 'rows'>;

/**
 * The velocity of the centre of mass, from differences between consecutive poses.
 *
 * It is relative to a foot that bears weight in both poses: the one with the greatest force now, else the first. Such a foot
 * neither slides nor turns about the vertical, whereas odometry drifts. The differences are smoothed by a first-order low-pass
 * filter with a time constant of 0.1 s, so the result lags by 0.1 s plus half the time between two poses. It restarts after more
 * than 0.75 s without a pose, when time goes backwards, and when no foot bears weight in both poses.
 */
export class CentreVelocity {
  /** m/s in the world; null while unknown. */
  value: Vec3 | null = null;
  /** Maps a point of the previous pose to its current position if that foot stands still; null for none. */
  slide: Slide | null = null;
  readonly #feet: readonly FootState[];
  /** The newest known state, and the pose that it continues from. */
  #velocity: Vec3 | null = null;
  #stood: readonly Stood[] = [];
  #centre: Vec3 | null = null;
  /** NaN before the first pose. */
  #tS = Number.NaN;

  constructor(feet: readonly FootState[]) {
    this.#feet = feet;
  }

  /** Takes the centre of mass (world, metres; null: no masses are known) and the feet of a pose. `unread`: the centre or the
   *  weight-bearing feet are unknown now. The velocity is then unknown too, and the previous state is kept for the next pose. */
  update(tS: number, centre: Vec3 | null, unread: boolean): void {
    if (!follows(this.#tS, tS)) {
      this.#velocity = this.#centre = null;
      this.#stood = [];
      this.#tS = Number.NaN;
    }
    this.value = this.slide = null;
    if (unread) return;
    const passed = tS - this.#tS;
    if (passed !== 0) {
      this.#velocity = this.#smoothed(centre, passed);
      this.#tS = tS;
      this.#centre = centre;
      this.#stood = this.#feet.map(({ bears, centre, rows }) => ({ bears, centre, rows }));
    }
    this.value = this.#velocity;
  }

  #smoothed(centre: Vec3 | null, passed: number): Vec3 | null {
    const shared = this.#sharedFoot();
    const [now, before] = [this.#feet[shared], this.#stood[shared]];
    if (now === undefined || before === undefined) return null;
    // The apparent rotation of the foot about the vertical: the twist of now_from_before.
    const ahead = dot(now.rows[0], before.rows[0]) + dot(now.rows[1], before.rows[1]);
    const aside = dot(now.rows[1], before.rows[0]) - dot(now.rows[0], before.rows[1]);
    const twist = Math.atan2(aside, ahead);
    const to = now.centre;
    this.slide = (at) => addScaled(to, rotateAbout(UP, twist, addScaled(at, before.centre, -1)));
    if (centre === null || this.#centre === null) return null;
    const raw = scale(addScaled(centre, this.slide(this.#centre), -1), 1 / passed);
    if (this.#velocity === null) return raw;
    const held = rotateAbout(UP, twist, this.#velocity);
    return addScaled(held, addScaled(raw, held, -1), -Math.expm1(-passed / SMOOTHED_S));
  }

  /** The foot that bears weight now and did before: the one with the greatest force, else the first; -1 for none. */
  #sharedFoot(): number {
    let best = -1;
    for (const [i, { bears, forceN }] of this.#feet.entries()) {
      if (!bears || !this.#stood[i]?.bears) continue;
      if (best < 0 || (forceN ?? 0) > (this.#feet[best]!.forceN ?? 0)) best = i;
    }
    return best;
  }
}
