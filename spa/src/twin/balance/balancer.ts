import type { Ground } from '@posecast/wire';
import { addScaled, pointThrough, scale, type Vec3 } from '../rotation.ts';
import type { Balance, BalanceGap, FootWrench, Slide, Standing, Vec2 } from './balance.ts';
import { CentreVelocity, follows } from './centre_velocity.ts';
import { FootState } from './foot_state.ts';
import { marginIn, spanOf } from './polygon.ts';

/** Standard gravity as a controller would use it, m/s². */
const GRAVITY = 9.81;

/**
 * The offset of the capture point from the centre of mass per m/s, seconds: √(z/g), with the height z of the centre of mass above
 * the floor (m). The capture point is x + ẋ·√(z/g): a robot that moves like a linear inverted pendulum has to step there to come
 * to rest (Pratt, Carff, Drakunov and Goswami, "Capture Point: A Step toward Humanoid Push Recovery", Humanoids 2006). At or
 * below the floor it is 0.
 */
export function captureTime(heightM: number): number {
  return Math.sqrt(Math.max(0, heightM) / GRAVITY);
}

/** A foot starts to bear weight at this fraction of the robot's weight, and stops below the other. */
const BEARS = 0.05;
const BEARS_NO_MORE = 0.03;
/** The weight (N) assumed if no masses are known: 5 % of it are 20 N. */
const UNKNOWN_WEIGHT_N = 400;
/** The maximum height above the lowest sole at which another one counts as standing, metres, if no force is measured. */
const LOWEST_M = 0.01;

const ORIGIN: Vec3 = [0, 0, 0];

/** Computes the balance of one robot, pose by pose in time order. The object itself is the balance of the newest pose: `update`
 *  overwrites it. */
export class Balancer implements Balance {
  readonly massKg: number;
  readonly ground: Ground | null;
  readonly feet: readonly FootState[];
  polygon: readonly Vec2[] = [];
  gaps: Balance['gaps'];
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
  #unread: BalanceGap = 'unread';

  constructor(standing: Standing) {
    this.#standing = standing;
    this.massKg = standing.masses.reduce((sum, { massKg }) => sum + massKg, 0);
    this.#weightN = this.massKg > 0 ? this.massKg * GRAVITY : UNKNOWN_WEIGHT_N;
    this.ground = standing.ground;
    this.feet = standing.feet.map((foot) => new FootState(foot));
    this.#velocity = new CentreVelocity(this.feet);
    this.gaps = this.#gapsWith(standing.massGap, standing.footGap, standing.footGap);
  }

  /** Takes a pose: world_from_link of every link (16 numbers each, column-major, metres), the wrenches of the same moment, and
   *  its time, seconds. `unread`: the reason for missing values where there is no reading or no finite position. */
  update(
    worldFromLink: Float64Array,
    wrenches: readonly FootWrench[],
    tS: number,
    unread: BalanceGap = 'unread',
  ): void {
    this.#unread = unread;
    const centreGap = this.#findCentre(worldFromLink);
    for (const foot of this.feet) {
      const wrench = wrenches.find(({ site }) => site === foot.foot.sensor?.site);
      foot.update(worldFromLink, wrench ?? null);
    }
    const gap = this.#findBearing(follows(this.#tS, tS));
    this.#tS = tS;
    this.#findPolygon(gap);
    this.#velocity.update(
      tS,
      this.centreOfMass,
      gap === unread || gap === 'no-wrench' || centreGap === unread,
    );
    this.velocity = this.#velocity.value;
    this.slide = this.#velocity.slide;
    this.#findCapturePoint();
    this.gaps = this.#gapsWith(centreGap, gap, this.#findPressure());
  }

  #gapsWith(centreOfMass: BalanceGap | null, polygon: BalanceGap | null, pressure: BalanceGap | null) {
    const margin = centreOfMass ?? polygon;
    const capturePoint = margin ?? (this.velocity === null ? 'first-pose' : null);
    return { centreOfMass, polygon, margin, pressure, capturePoint };
  }

  /** Σ m·p / Σ m. Returns the reason if it is unknown, else null. */
  #findCentre(worldFromLink: Float64Array): BalanceGap | null {
    const { masses, massGap } = this.#standing;
    this.centreOfMass = null;
    if (masses.length === 0) return massGap;
    const sum = masses.reduce<Vec3>((all, { link, massKg, xyz }) => {
      const at = pointThrough(worldFromLink.subarray(link * 16, link * 16 + 16), xyz);
      return addScaled(all, at, massKg);
    }, ORIGIN);
    if (!sum.every(Number.isFinite)) return this.#unread;
    this.centreOfMass = scale(sum, 1 / this.massKg);
    return massGap;
  }

  /** Determines which feet bear weight; returns the reason if there is no polygon, else null. */
  #findBearing(goesOn: boolean): BalanceGap | null {
    if (this.feet.length === 0) return this.#standing.footGap;
    const leastN = BEARS_NO_MORE * this.#weightN;
    const lowest = Math.min(...this.feet.map(({ lowestM }) => lowestM)); // NaN takes precedence
    let gap: BalanceGap | null = 'airborne';
    let bearing = 0;
    for (const foot of this.feet) {
      const { lowestM, forceN, isTilted } = foot;
      const wasBearing = goesOn && foot.bears;
      let bears: boolean | null;
      if (Number.isNaN(lowest)) bears = null;
      else if (isTilted) bears = false;
      else if (this.ground === 'lowest') bears = lowestM <= lowest + LOWEST_M;
      else if (forceN === null) bears = null;
      else bears = forceN >= (wasBearing ? BEARS_NO_MORE : BEARS) * this.#weightN;
      foot.setBears(bears, leastN);
      if (bears) bearing += 1;
      else if (bears === null && gap !== 'no-wrench')
        gap = this.ground === 'measured' && !foot.foot.sensor?.measuresForce ? 'no-wrench' : this.#unread;
    }
    return gap === 'airborne' && bearing > 0 ? null : gap;
  }

  /** The floor, the support polygon, and its margin. */
  #findPolygon(gap: BalanceGap | null): void {
    this.polygon = [];
    this.floorM = this.nearestEdge = this.marginM = null;
    if (gap !== null) return;
    const bearing = this.feet.filter(({ bears }) => bears);
    this.floorM = Math.min(...bearing.map(({ lowestM }) => lowestM)) + 0; // never -0
    this.polygon = spanOf(bearing);
    if (this.centreOfMass === null) return;
    const [x, y] = this.centreOfMass;
    const { metres, edge } = marginIn(this.polygon, [x, y]);
    this.marginM = metres;
    this.nearestEdge = edge;
  }

  /**
   * The mean of the feet's centres of pressure, weighted by their forces, on the floor. A foot that does not bear weight counts
   * if it is pressed in the same direction as the foot with the greatest force: 4 % of the weight 20 cm away are 8 mm. A foot
   * under tension is hanging, pulled by its own weight below the sensor. Returns the reason if there is none, else null.
   */
  #findPressure(): BalanceGap | null {
    this.pressure = null;
    let gap: BalanceGap | null = this.#standing.footGap;
    let strongest = 0;
    for (const { foot, bears, forceN, pushedAt, pressN } of this.feet) {
      if (!foot.sensor?.measuresPressure) gap = 'no-wrench';
      else if (forceN === null || bears === null || (bears && pushedAt === null && pressN !== 0))
        gap ??= this.#unread;
      if (Math.abs(pressN) > Math.abs(strongest)) strongest = pressN;
    }
    if (strongest === 0 || this.floorM === null) gap ??= 'airborne';
    let [sum, sx, sy] = [0, 0, 0];
    for (const { bears, pushedAt, pressN } of this.feet) {
      if (pushedAt === null || (!bears && pressN * strongest < 0)) continue;
      const force = Math.abs(pressN);
      sum += force;
      sx += force * pushedAt[0];
      sy += force * pushedAt[1];
    }
    if (sum === 0) gap ??= this.#unread; // the only foot with force measures no moments
    if (gap === null && this.floorM !== null) this.pressure = [sx / sum, sy / sum, this.floorM];
    return gap;
  }

  #findCapturePoint(): void {
    const { centreOfMass: centre, velocity, floorM: floor } = this;
    this.capturePoint = null;
    if (centre === null || velocity === null || floor === null) return;
    const ahead = captureTime(centre[2] - floor);
    this.capturePoint = [centre[0] + velocity[0] * ahead, centre[1] + velocity[1] * ahead, floor];
  }
}
