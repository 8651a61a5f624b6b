import { type Level, level, type Threshold } from '@posecast/wire';
import { type ValueLimits, worseOf } from '../limits.ts';
import type { Balance, BalanceGap, Vec2 } from './balance.ts';
import { fromEdge, marginIn, spanOf } from './polygon.ts';

/** A direction from the robot's own point of view. */
type Side = 'forwards' | 'backwards' | 'left' | 'right';

/** A different direction is named only if it dominates by this factor: near 45° it would flicker. */
const CLEARLY = 1.25;

/** The direction in which a robot would fall if its centre of mass is outside its support: from the nearest point of the edge to
 *  the centre of mass. `before`: the previous result. null if there is no edge. */
export function fallDirection(
  { centreOfMass, polygon, nearestEdge }: Pick<Balance, 'centreOfMass' | 'polygon' | 'nearestEdge'>,
  headingRad: number,
  before: Side | null,
): Side | null {
  const from = nearestEdge === null ? undefined : polygon[nearestEdge];
  if (centreOfMass === null || from === undefined) return null;
  const to = polygon[(nearestEdge! + 1) % polygon.length]!;
  const [x, y] = fromEdge<Vec2>(from, to, [centreOfMass[0], centreOfMass[1]]);
  const [cos, sin] = [Math.cos(headingRad), Math.sin(headingRad)];
  const ahead = x * cos + y * sin;
  const left = y * cos - x * sin;
  const along: Side = ahead >= 0 ? 'forwards' : 'backwards';
  const across: Side = left >= 0 ? 'left' : 'right';
  const held = before === along ? CLEARLY : before === across ? 1 / CLEARLY : 1;
  return Math.abs(ahead) * held >= Math.abs(left) ? along : across;
}

/**
 * The reported state of a robot's balance.
 *
 * - `inside`, `edge`, `outside`: the position of the centre of mass, seen from above, relative to the edge of the support.
 * - `moving`: it is outside, but the robot's motion would bring it to rest over its feet, assuming that a raised foot is set
 *   down: it is walking.
 * - `airborne`: no foot bears weight.
 * - `unread`: a foot has no reading, so the state is unknown. `orientation-unread`, `joint-unread`: unknown as well, because the
 *   sensor of the body's orientation or a joint that carries weight has no reading.
 */
export type StanceKind = 'inside' | 'edge' | 'outside' | 'moving' | Without;

type Without = Extract<BalanceGap, 'airborne' | `${string}unread`>;

/** The report about one balance. */
export interface Stance {
  readonly kind: StanceKind;
  readonly level: Level;
  /** Positive inside, negative outside; null if unknown. */
  readonly marginMm: number | null;
  /** The direction of the fall relative to the robot's heading; null unless it is outside. */
  readonly side: Side | null;
  /** The support is assumed, not measured. */
  readonly assumed: boolean;
}

/** Within this distance, the centre of mass counts as on the edge: neither in nor out. */
const EDGE_MM = 1;
/** The extra distance to be called inside or outside again, or to get a better level. */
const BACK_MM = 2;

/** How far inside it must come to rest to count as moving. */
const CAUGHT_M = 0.005;

/** From this speed of the centre of mass on, m/s, a raised foot counts: a robot that balances on one leg sets none down. */
const STEPPING_MPS = 0.03;

/** Judges one balance after another, so that text and levels don't flicker if a value is near a limit: a level rises at once and
 *  falls only when the margin is well back. */
export class StanceJudge {
  #last: Stance | null = null;
  #limits: MarginLimits | null = null;

  /** The newest balance; `headingRad` from the world's x axis. null: nothing can be said, as for an arm. */
  next(balance: Balance, headingRad: number, limits: MarginLimits): Stance | null {
    if (this.#last !== null && limits !== this.#limits) this.#last = { ...this.#last, level: 'ok' }; // the limits have changed
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
    // The page's own limit is about falling, and a robot that comes to rest over its feet does not fall.
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

/** The name of the margin where limits and plots are stored by field and label. */
export const MARGIN = { field: 'balance', label: 'margin' } as const;

/** The source of the margin limits: the viewer, the profile, or the page's defaults if nobody has set any. */
export type LimitsOwner = 'viewer' | 'profile' | 'page';

/** The limits for caution and fault of the margin (mm). */
export interface MarginLimits {
  readonly owner: LimitsOwner;
  readonly levelAt: (marginMm: number) => Level;
  /** The threshold reported for a crossing, mm. */
  readonly threshold: Threshold;
}

/** Without explicit limits, the margin is amber below this, and red outside. */
export const CAUTION_BELOW_MM = 20;

const OF_PAGE: MarginLimits = {
  owner: 'page',
  levelAt: (marginMm) => (marginMm < 0 ? 'fault' : marginMm < CAUTION_BELOW_MM ? 'caution' : 'ok'),
  threshold: { low: 0, high: null, caution: 1 },
};

let ofPage: readonly [ValueLimits | null, MarginLimits] = [null, OF_PAGE];

/** The current limits of the margin; the same object as long as `limits` is the same. */
export function marginLimits(limits: ValueLimits | null): MarginLimits {
  if (limits !== ofPage[0]) ofPage = [limits, limitsFrom(limits)];
  return ofPage[1];
}

/** The limits that somebody has set. */
export function limitsBy(threshold: Threshold, owner: LimitsOwner): MarginLimits {
  return { owner, levelAt: (marginMm) => level(threshold, marginMm), threshold };
}

function limitsFrom(limits: ValueLimits | null): MarginLimits {
  const threshold = limits?.threshold(MARGIN.field, MARGIN.label) ?? null;
  if (limits === null || threshold === null) return OF_PAGE;
  return limitsBy(threshold, limits.edited(MARGIN.field, MARGIN.label) ? 'viewer' : 'profile');
}
