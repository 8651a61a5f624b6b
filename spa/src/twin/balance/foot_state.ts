import { addScaled, cross, dot, pointThrough, scale, type Vec3 } from '../rotation.ts';
import type { Foot, FootBalance, FootWrench, SolePlane } from './balance.ts';

/** A centre of pressure this near to the sole's edge counts as on it, metres. */
const AT_EDGE_M = 0.005;
/** A centre of pressure farther outside the sole (metres) is invalid: there is no floor under it. */
const OUTSIDE_M = 0.2;
/** Cosine of the maximum tilt of a weight-bearing sole: 60°. */
const TILT_COS = 0.5;

type Rows = readonly [Vec3, Vec3, Vec3];

/** One foot in the newest pose. `update` and `setBears` overwrite it, in this order. */
export class FootState implements FootBalance {
  readonly name: string;
  readonly link: string;
  corners: readonly Vec3[] = [];
  normal: Vec3 = [0, 0, 1];
  bears: boolean | null = null;
  forceN: number | null = null;
  pressure: Vec3 | null = null;
  atEdge = false;
  /** The force along the sole's normal with the sensor's sign, N; 0 if unknown. */
  pressN = 0;
  /** The centre of pressure (world, metres), even if the foot bears no weight; null if the wrench has no such point. */
  pushedAt: Vec3 | null = null;
  /** Height of its lowest corner, metres in the world; infinite while it is tilted. */
  lowestM = Number.NaN;
  /** Whether its sole is tilted by more than 60°, or upside down, so that it can't carry the robot. */
  isTilted = false;
  /** The sole's centre in the world, metres. */
  centre: Vec3 = [0, 0, 0];
  /** The rows of the rotation of world_from_link. */
  rows!: Rows;
  readonly foot: Foot;
  /** The centre of pressure in the link's frame. */
  #pressed: Vec3 | null = null;

  constructor(foot: Foot) {
    this.foot = foot;
    this.name = foot.name;
    this.link = foot.linkName;
  }

  /** Takes the pose of its link (world_from_link, in an array of transforms) and its wrench; null: not measured, or no
   *  reading. */
  update(worldFromLink: Float64Array, wrench: FootWrench | null): void {
    const { link, sole } = this.foot;
    const m = worldFromLink.subarray(link * 16, link * 16 + 16);
    this.corners = sole.corners.map((corner) => pointThrough(m, corner));
    this.centre = pointThrough(m, sole.centre);
    const rows = [0, 1, 2].map((i): Vec3 => [m[i]!, m[i + 4]!, m[i + 8]!]);
    this.rows = rows as unknown as Rows;
    this.normal = rows.map((row) => dot(row, sole.normal)) as unknown as Vec3;
    this.isTilted = this.normal[2] < TILT_COS;
    const lowest = Math.min(...this.corners.map(([, , z]) => z)); // NaN takes precedence
    this.lowestM = this.isTilted ? Number.POSITIVE_INFINITY : lowest;
    this.#takeWrench(wrench);
    this.pushedAt = this.#pressed && pointThrough(m, this.#pressed);
  }

  /** Sets whether it bears weight. Below `leastN`, the centre of pressure is not worth showing. */
  setBears(bears: boolean | null, leastN: number): void {
    this.bears = bears;
    this.pressure = bears && this.forceN !== null && this.forceN >= leastN ? this.pushedAt : null;
    this.atEdge =
      this.pressure !== null && this.#pressed !== null && !isInside(this.foot.sole, this.#pressed, AT_EDGE_M);
  }

  /**
   * Takes the wrench. The centre of pressure is p = O + (n × M_O)/(f·n), with O the sole's centre (Sardain and Bessonnet, "Forces
   * Acting on a Biped Robot. Center of Pressure – Zero Moment Point", IEEE Trans. SMC-A 34, 2004). The result is the same whether
   * the sensor reports the force of the floor on the foot or of the foot on the floor.
   */
  #takeWrench(wrench: FootWrench | null): void {
    const { sensor, sole } = this.foot;
    this.forceN = this.#pressed = null;
    this.pressN = 0;
    if (sensor === null || !sensor.measuresForce || !wrench?.force.vector) return;
    const force = turned(sensor.axes, wrench.force.vector);
    this.pressN = dot(sole.normal, force);
    this.forceN = Math.abs(this.pressN);
    if (!sensor.measuresPressure || wrench.moment.vector === null || this.pressN === 0) return;
    const arm = addScaled(sensor.xyz, sole.centre, -1);
    const moment = addScaled(turned(sensor.axes, wrench.moment.vector), cross(arm, force));
    const pressed = addScaled(sole.centre, cross(sole.normal, moment), 1 / this.pressN);
    if (isInside(sole, pressed, -OUTSIDE_M)) this.#pressed = pressed;
  }
}

/** Converts a vector from a sensor's axes to the frame in which these axes are given. */
function turned([ex, ey, ez]: readonly [Vec3, Vec3, Vec3], [x, y, z]: Vec3): Vec3 {
  return addScaled(addScaled(scale(ex, x), ey, y), ez, z);
}

/** Whether a point in a sole's plane is at least this far inside every edge, metres. */
function isInside({ corners, normal }: SolePlane, point: Vec3, metres: number): boolean {
  return corners.every((from, i) => {
    const edge = addScaled(corners[(i + 1) % corners.length]!, from, -1);
    const turn = dot(normal, cross(edge, addScaled(point, from, -1)));
    return turn >= metres * Math.hypot(...edge);
  });
}
