import type { Level } from '@posecast/wire';
import { worseOf } from '../../limits/level_latch.ts';
import type { Balance, BalanceGap } from '../balance.ts';
import { spanOf } from '../convex_hull.ts';
import { marginIn } from '../margin.ts';
import { fallDirection, type Side } from './direction.ts';
import type { MarginLimits } from './margin_limits.ts';

/**
 * What is said of a robot's balance.
 *
 * - `inside`, `edge`, `outside`: where the centre of mass is, seen from above, to the edge of what it stands on.
 * - `moving`: it is outside, but the robot moves so that it would come to rest over its feet, with one that is in the air
 *   set down: so it walks.
 * - `airborne`: no foot bears weight; `unread`: a foot has no reading, so nobody knows; `orientation-unread`,
 *   `joint-unread`: nor where what tells how the body is turned, or a joint that carries weight, has none.
 */
export type StanceKind = 'inside' | 'edge' | 'outside' | 'moving' | Without;

type Without = Extract<BalanceGap, 'airborne' | `${string}unread`>;

/** What is told of one balance. */
export interface Stance {
  readonly kind: StanceKind;
  readonly level: Level;
  /** Positive inside, negative outside; null while there is none. */
  readonly marginMm: number | null;
  /** Where it would fall, by its own heading; null unless it is outside. */
  readonly side: Side | null;
  /** What it stands on is assumed, not measured. */
  readonly assumed: boolean;
}

/** Within this the centre of mass is called on the edge: neither in nor out. */
const EDGE_MM = 1;
/** So much further it has to go to be called inside or outside again, or for a better level. */
const BACK_MM = 2;

/** So far inside it would have to come to rest to be called moving. */
const CAUGHT_M = 0.005;

/** From this speed of the centre of mass on, m/s, a foot in the air counts: a robot that stands on one leg sets none down. */
const STEPPING_MPS = 0.03;

/** Judges one balance after the other, so that words and levels don't flicker where a value lies at a limit: a level rises at
 *  once and falls when the margin is well back. */
export class StanceJudge {
  #last: Stance | null = null;
  #limits: MarginLimits | null = null;

  /** The newest balance; `headingRad` from the world's x. null: nothing can be said, as of an arm. */
  next(balance: Balance, headingRad: number, limits: MarginLimits): Stance | null {
    if (this.#last !== null && limits !== this.#limits) this.#last = { ...this.#last, level: 'ok' }; // by other limits
    this.#limits = limits;
    this.#last = this.#judge(balance, headingRad, limits);
    return this.#last;
  }

  #judge(balance: Balance, headingRad: number, limits: MarginLimits): Stance | null {
    const { marginM, ground, gaps } = balance;
    const assumed = ground === 'lowest';
    if (marginM === null) {
      const kind = gaps.polygon as Without;
      return !/unread|airborne/.test(kind)
        ? null
        : { kind, level: 'ok', marginMm: null, side: null, assumed };
    }
    const marginMm = marginM * 1000;
    const caught = marginMm < 0 && this.#isCaught(balance);
    const kind = this.#kindOf(marginMm, caught);
    const level = this.#levelOf(marginMm, caught, limits);
    const side = kind === 'outside' ? fallDirection(balance, headingRad, this.#last?.side ?? null) : null;
    return { kind, level, marginMm, side, assumed };
  }

  #kindOf(marginMm: number, caught: boolean): StanceKind {
    const wasOnEdge = this.#last?.kind === 'edge';
    if (Math.abs(marginMm) <= (wasOnEdge ? EDGE_MM + BACK_MM : EDGE_MM)) return 'edge';
    if (marginMm > 0) return 'inside';
    return caught ? 'moving' : 'outside';
  }

  /** Whether it would come to rest over its feet. */
  #isCaught(balance: Balance): boolean {
    const { capturePoint, polygon, velocity } = balance;
    if (capturePoint === null || polygon.length === 0) return false;
    const [x, y] = capturePoint;
    const steps = velocity !== null && Math.hypot(velocity[0], velocity[1]) >= STEPPING_MPS;
    const { metres } = marginIn(steps ? spanOf(balance.feet) : polygon, [x, y]);
    return metres >= (this.#last?.kind === 'moving' ? 0 : CAUGHT_M);
  }

  #levelOf(marginMm: number, caught: boolean, limits: MarginLimits): Level {
    const { levelAt, owner } = limits;
    // The page's own limit is about falling, and who comes to rest over their feet does not fall.
    const eased = (level: Level) => (caught && owner === 'page' ? 'caution' : level);
    const now = eased(levelAt(marginMm));
    const lingering = eased(worseOf(levelAt(marginMm - BACK_MM), levelAt(marginMm + BACK_MM)));
    const held = this.#last?.level ?? 'ok';
    return worseOf(now, held) === now ? now : lesser(held, worseOf(now, lingering));
  }
}

function lesser(a: Level, b: Level): Level {
  return worseOf(a, b) === a ? b : a;
}
