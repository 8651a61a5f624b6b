import type { Ground } from '@posecast/wire';
import type { Vec3 } from '../rotation.ts';
import { addScaled, pointThrough, scale } from '../vectors.ts';
import type { Balance, BalanceGap, Vec2 } from './balance.ts';
import { captureTime, GRAVITY } from './capture_point.ts';
import { CentreVelocity, follows, type Slide } from './centre_velocity.ts';
import { convexHull } from './convex_hull.ts';
import { FootState } from './foot_state.ts';
import { marginIn } from './margin.ts';
import type { FootWrench, Standing } from './standing.ts';

/** A foot begins to bear at this part of the weight, and stops below the other. */
const BEARS = 0.05;
const BEARS_NO_MORE = 0.03;
/** The weight (N) whose parts stand in when no masses are known: 5 % of it are 20 N. */
const UNKNOWN_WEIGHT_N = 400;
/** How far above the lowest sole another one counts as standing, metres, while no force is measured. */
const LOWEST_M = 0.01;

const ORIGIN: Vec3 = [0, 0, 0];

type Gaps = { -readonly [part in keyof Balance['gaps']]: BalanceGap | null };

/** Computes the balance of one robot, pose by pose in the order of time. It is itself the balance of the newest pose:
 *  `update` rewrites it. */
export class Balancer implements Balance {
  readonly massKg: number;
  readonly ground: Ground | null;
  readonly feet: readonly FootState[];
  polygon: readonly Vec2[] = [];
  readonly gaps: Gaps;
  centreOfMass: Vec3 | null = null;
  velocity: Vec3 | null = null;
  slide: Slide | null = null;
  capturePoint: Vec3 | null = null;
  floorM: number | null = null;
  nearestEdge: number | null = null;
  marginM: number | null = null;
  pressure: Vec3 | null = null;
  readonly #standing: Standing;
  readonly #weightN: number;
  readonly #velocity: CentreVelocity;
  #tS = Number.NaN;

  constructor(standing: Standing) {
    this.#standing = standing;
    this.massKg = standing.masses.reduce((sum, { massKg }) => sum + massKg, 0);
    this.#weightN = this.massKg > 0 ? this.massKg * GRAVITY : UNKNOWN_WEIGHT_N;
    this.ground = standing.ground;
    this.feet = standing.feet.map((foot) => new FootState(foot));
    this.#velocity = new CentreVelocity(this.feet);
    const { massGap, footGap } = standing;
    this.gaps = {
      ...{ centreOfMass: massGap, polygon: footGap, margin: massGap ?? footGap },
      ...{ pressure: footGap, capturePoint: massGap ?? footGap },
    };
  }

  /** Takes a pose: world_from_link of every link (16 numbers each, column-major, metres), the wrenches of the same
   *  moment, and its time, seconds. */
  update(worldFromLink: Float64Array, wrenches: readonly FootWrench[], tS: number): void {
    this.#findCentre(worldFromLink);
    for (const foot of this.feet) {
      const wrench = wrenches.find(({ site }) => site === foot.foot.sensor?.site);
      foot.update(worldFromLink, wrench ?? null);
    }
    const gap = this.#findBearing(follows(this.#tS, tS));
    this.#tS = tS;
    this.#findPolygon(gap);
    this.#findPressure();
    const unread = gap === 'unread' || gap === 'no-wrench' || this.gaps.centreOfMass === 'unread';
    this.#velocity.update(tS, this.centreOfMass, unread);
    this.velocity = this.#velocity.value;
    this.slide = this.#velocity.slide;
    this.#findCapturePoint();
  }

  /** Σ m·p / Σ m. */
  #findCentre(worldFromLink: Float64Array): void {
    const { masses, massGap } = this.#standing;
    this.gaps.centreOfMass = massGap;
    this.centreOfMass = null;
    if (masses.length === 0) return;
    const sum = masses.reduce<Vec3>((all, { link, massKg, xyz }) => {
      const at = pointThrough(worldFromLink.subarray(link * 16, link * 16 + 16), xyz);
      return addScaled(all, at, massKg);
    }, ORIGIN);
    if (sum.every(Number.isFinite)) this.centreOfMass = scale(sum, 1 / this.massKg);
    else this.gaps.centreOfMass = 'unread';
  }

  /** Finds which feet bear; returns why there is no polygon, null when there is one. */
  #findBearing(goesOn: boolean): BalanceGap | null {
    if (this.feet.length === 0) return this.#standing.footGap;
    const leastN = BEARS_NO_MORE * this.#weightN;
    const heights = this.feet.map(({ lowestM, isTilted }) => {
      if (!Number.isFinite(lowestM)) return Number.NaN;
      return isTilted ? Number.POSITIVE_INFINITY : lowestM;
    });
    const lowest = Math.min(...heights); // NaN wins
    let gap: BalanceGap | null = 'airborne';
    let bearing = 0;
    for (const foot of this.feet) {
      const { lowestM, forceN, isTilted } = foot;
      const wasBearing = goesOn && foot.bears === true;
      let bears: boolean | null;
      if (Number.isNaN(lowest)) bears = null;
      else if (isTilted) bears = false;
      else if (this.ground === 'lowest') bears = lowestM <= lowest + LOWEST_M;
      else if (forceN === null) bears = null;
      else bears = forceN >= (wasBearing ? BEARS_NO_MORE : BEARS) * this.#weightN;
      foot.setBears(bears, leastN);
      if (bears === true) bearing += 1;
      else if (bears === null && gap !== 'no-wrench')
        gap = lacksForce(foot, this.ground) ? 'no-wrench' : 'unread';
    }
    return gap === 'airborne' && bearing > 0 ? null : gap;
  }

  /** The floor, the support polygon, and the margin in it. */
  #findPolygon(gap: BalanceGap | null): void {
    this.gaps.polygon = gap;
    this.gaps.margin = this.gaps.centreOfMass ?? gap;
    this.polygon = [];
    this.floorM = this.nearestEdge = this.marginM = null;
    if (gap !== null) return;
    const bearing = this.feet.filter(({ bears }) => bears === true);
    this.floorM = Math.min(...bearing.map(({ lowestM }) => lowestM)) + 0; // never -0
    const points = bearing.flatMap(({ corners }) => corners.map(([x, y]): Vec2 => [x, y]));
    this.polygon = convexHull(points).map((i) => points[i]!);
    if (this.centreOfMass === null) return;
    const [x, y] = this.centreOfMass;
    const { metres, edge } = marginIn(this.polygon, [x, y]);
    this.marginM = metres;
    this.nearestEdge = edge;
  }

  /**
   * The mean of the feet's centres of pressure, weighted by their forces, on the floor. A foot that does not bear counts
   * while it is pressed as the foot with the greatest force is: 4 % of the weight 20 cm away are 8 mm. One that is pulled
   * hangs, by its own weight below the sensor.
   */
  #findPressure(): void {
    this.pressure = null;
    let gap: BalanceGap | null = this.#standing.footGap;
    let strongest = 0;
    for (const { foot, bears, forceN, pushedAt, pressN } of this.feet) {
      if (!(foot.sensor?.measuresPressure ?? false)) gap = 'no-wrench';
      else if (gap === null && (forceN === null || bears === null)) gap = 'unread';
      else if (gap === null && bears === true && pushedAt === null && pressN !== 0) gap = 'unread';
      if (Math.abs(pressN) > Math.abs(strongest)) strongest = pressN;
    }
    if (gap === null && (strongest === 0 || this.floorM === null)) gap = 'airborne';
    let [sum, sx, sy] = [0, 0, 0];
    for (const { bears, pushedAt, pressN } of this.feet) {
      if (pushedAt === null || (bears !== true && pressN * strongest < 0)) continue;
      const force = Math.abs(pressN);
      sum += force;
      sx += force * pushedAt[0];
      sy += force * pushedAt[1];
    }
    if (gap === null && sum === 0) gap = 'unread'; // the only force has no moments
    this.gaps.pressure = gap;
    if (gap !== null || this.floorM === null) return;
    this.pressure = [sx / sum, sy / sum, this.floorM];
  }

  #findCapturePoint(): void {
    const { centreOfMass: centre, velocity, floorM: floor, gaps } = this;
    this.capturePoint = null;
    gaps.capturePoint = gaps.margin ?? (velocity === null ? 'first-pose' : null);
    if (centre === null || velocity === null || floor === null) return;
    const ahead = captureTime(centre[2] - floor);
    this.capturePoint = [centre[0] + velocity[0] * ahead, centre[1] + velocity[1] * ahead, floor];
  }
}

function lacksForce(foot: FootState, ground: Ground | null): boolean {
  return ground === 'measured' && !(foot.foot.sensor?.measuresForce ?? false);
}
