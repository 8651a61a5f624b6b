import type { Ground } from '@posecast/wire';
import type { Vec3 } from '../rotation.ts';
import type { Balance, BalanceGap, Vec2 } from './balance.ts';
import { captureTime, GRAVITY } from './capture_point.ts';
import { CentreVelocity, follows } from './centre_velocity.ts';
import { ConvexHull } from './convex_hull.ts';
import { FootState, type Triple } from './foot_state.ts';
import { type Margin, writeMargin } from './margin.ts';
import type { FootWrench, Standing } from './standing.ts';

/** A foot begins to bear at this part of the weight, and stops below the other. */
const BEARS = 0.05;
const BEARS_NO_MORE = 0.03;
/** The weight (N) whose parts stand in when no masses are known: 5 % of it are 20 N. */
const UNKNOWN_WEIGHT_N = 400;
/** How far above the lowest sole another one counts as standing, metres, while no force is measured. */
const LOWEST_M = 0.01;

type Gaps = { -readonly [part in keyof Balance['gaps']]: BalanceGap | null };

/** Computes the balance of one robot, pose by pose in the order of time, without allocating. It is itself the balance
 *  of the newest pose: `update` rewrites it. */
export class Balancer implements Balance {
  readonly massKg: number;
  readonly ground: Ground | null;
  readonly feet: readonly FootState[];
  readonly polygon: Vec2[] = [];
  readonly gaps: Gaps;
  centreOfMass: Vec3 | null = null;
  velocity: Vec3 | null = null;
  capturePoint: Vec3 | null = null;
  floorM: number | null = null;
  nearestEdge: number | null = null;
  marginM: number | null = null;
  pressure: Vec3 | null = null;
  readonly #standing: Standing;
  readonly #weightN: number;
  readonly #centre: Triple = [0, 0, 0];
  readonly #captured: Triple = [0, 0, 0];
  readonly #pressed: Triple = [0, 0, 0];
  /** Corners of the soles that bear, on the floor. */
  readonly #points: Float64Array;
  readonly #hull: ConvexHull;
  /** As many corners as a polygon can have; `polygon` holds the first of them. */
  readonly #corners: readonly [number, number][];
  readonly #margin: Margin = { metres: 0, edge: 0 };
  readonly #velocity: CentreVelocity;
  #tS = Number.NaN;

  constructor(standing: Standing) {
    this.#standing = standing;
    this.massKg = standing.masses.reduce((sum, { massKg }) => sum + massKg, 0);
    this.#weightN = this.massKg > 0 ? this.massKg * GRAVITY : UNKNOWN_WEIGHT_N;
    this.ground = standing.ground;
    this.feet = standing.feet.map((foot) => new FootState(foot));
    const most = this.feet.reduce((sum, { corners }) => sum + corners.length, 0);
    this.#points = new Float64Array(2 * most);
    this.#hull = new ConvexHull(most);
    this.#corners = Array.from({ length: most }, (): [number, number] => [0, 0]);
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
    for (const foot of this.feet) foot.update(worldFromLink, wrenchOf(wrenches, foot.foot.sensor?.site));
    const gap = this.#findBearing(follows(this.#tS, tS));
    this.#tS = tS;
    this.#findPolygon(gap);
    this.#findPressure();
    const unread = gap === 'unread' || gap === 'no-wrench';
    this.#velocity.update(tS, this.centreOfMass, unread);
    this.velocity = this.#velocity.value;
    this.#findCapturePoint();
  }

  /** Σ m·p / Σ m. */
  #findCentre(m: Float64Array): void {
    const { masses, massGap } = this.#standing;
    this.gaps.centreOfMass = massGap;
    this.centreOfMass = null;
    if (masses.length === 0) return;
    let [sx, sy, sz] = [0, 0, 0];
    for (const { link, massKg, xyz } of masses) {
      const at = link * 16;
      const [x, y, z] = xyz;
      sx += massKg * (m[at]! * x + m[at + 4]! * y + m[at + 8]! * z + m[at + 12]!);
      sy += massKg * (m[at + 1]! * x + m[at + 5]! * y + m[at + 9]! * z + m[at + 13]!);
      sz += massKg * (m[at + 2]! * x + m[at + 6]! * y + m[at + 10]! * z + m[at + 14]!);
    }
    const centre = this.#centre;
    centre[0] = sx / this.massKg;
    centre[1] = sy / this.massKg;
    centre[2] = sz / this.massKg;
    if (Number.isFinite(centre[0] + centre[1] + centre[2])) this.centreOfMass = centre;
    else this.gaps.centreOfMass = 'unread';
  }

  /** Finds which feet bear; returns why there is no polygon, null when there is one. */
  #findBearing(goesOn: boolean): BalanceGap | null {
    if (this.feet.length === 0) return this.#standing.footGap;
    const leastN = BEARS_NO_MORE * this.#weightN;
    let lowest = Number.POSITIVE_INFINITY;
    for (const { lowestM } of this.feet) lowest = Math.min(lowest, lowestM); // NaN wins
    let gap: BalanceGap | null = 'airborne';
    let bearing = 0;
    for (const foot of this.feet) {
      const { lowestM, forceN } = foot;
      const wasBearing = goesOn && foot.bears === true;
      let bears: boolean | null;
      if (!Number.isFinite(lowest)) bears = null;
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
    this.polygon.length = 0;
    this.floorM = this.nearestEdge = this.marginM = null;
    if (gap !== null) return;
    let size = 0;
    let floor = Number.POSITIVE_INFINITY;
    for (const { bears, corners, lowestM } of this.feet) {
      if (bears !== true) continue;
      floor = Math.min(floor, lowestM);
      for (const [x, y] of corners) {
        this.#points[2 * size] = x;
        this.#points[2 * size + 1] = y;
        size += 1;
      }
    }
    this.floorM = floor;
    this.#hull.update(this.#points, size);
    for (let i = 0; i < this.#hull.count; i += 1) {
      const point = this.#hull.corners[i]!;
      const corner = this.#corners[i]!;
      corner[0] = this.#points[2 * point]!;
      corner[1] = this.#points[2 * point + 1]!;
      this.polygon.push(corner);
    }
    const centre = this.centreOfMass;
    if (centre === null) return;
    writeMargin(this.polygon, centre[0], centre[1], this.#margin);
    this.marginM = this.#margin.metres;
    this.nearestEdge = this.#margin.edge;
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
    this.#pressed[0] = sx / sum;
    this.#pressed[1] = sy / sum;
    this.#pressed[2] = this.floorM;
    this.pressure = this.#pressed;
  }

  #findCapturePoint(): void {
    const { centreOfMass: centre, velocity, floorM: floor, gaps } = this;
    this.capturePoint = null;
    gaps.capturePoint = gaps.margin ?? (velocity === null ? 'first-pose' : null);
    if (centre === null || velocity === null || floor === null) return;
    const ahead = captureTime(centre[2] - floor);
    this.#captured[0] = centre[0] + velocity[0] * ahead;
    this.#captured[1] = centre[1] + velocity[1] * ahead;
    this.#captured[2] = floor;
    this.capturePoint = this.#captured;
  }
}

function wrenchOf(wrenches: readonly FootWrench[], site: string | undefined): FootWrench | null {
  for (const wrench of wrenches) if (wrench.site === site) return wrench;
  return null;
}

function lacksForce(foot: FootState, ground: Ground | null): boolean {
  return ground === 'measured' && !(foot.foot.sensor?.measuresForce ?? false);
}
