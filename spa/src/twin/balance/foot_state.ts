import type { Vec3 } from '../rotation.ts';
import type { FootBalance } from './balance.ts';
import type { Foot, FootWrench, SolePlane } from './standing.ts';

export type Triple = [number, number, number];

/** How near to the sole's edge the centre of pressure counts as on it, metres. */
const AT_EDGE_M = 0.005;

/** One foot in the newest pose. `update` and `setBears` rewrite it, in this order. */
export class FootState implements FootBalance {
  readonly name: string;
  readonly link: string;
  readonly corners: readonly Triple[];
  bears: boolean | null = null;
  forceN: number | null = null;
  pressure: Vec3 | null = null;
  atEdge = false;
  /** The force along the sole's normal with the sensor's sign, N; 0 when it is not known. */
  pressN = 0;
  /** Where the floor pushes (world, metres), also while it does not bear; null when the wrench has no such point. */
  pushedAt: Vec3 | null = null;
  /** Height of its lowest corner, metres in the world. */
  lowestM = Number.NaN;
  /** The sole's centre in the world, metres. */
  readonly centre: Triple = [0, 0, 0];
  /** The first two rows of the rotation of world_from_link. */
  readonly rows = new Float64Array(6);
  readonly foot: Foot;
  /** The centre of pressure in the link's frame, and in the world. */
  readonly #pressed: Triple = [0, 0, 0];
  readonly #pushed: Triple = [0, 0, 0];
  /** The wrench at the sole's centre, in the link's frame: N, N·m. */
  readonly #force: Triple = [0, 0, 0];
  readonly #moment: Triple = [0, 0, 0];
  /** Whether the newest wrench has all that the centre of pressure takes. */
  #whole = false;

  constructor(foot: Foot) {
    this.foot = foot;
    this.name = foot.name;
    this.link = foot.linkName;
    this.corners = foot.sole.corners.map((): Triple => [0, 0, 0]);
  }

  /** Takes the place of its link (world_from_link, in an array of transforms) and its wrench; null: none measured or no
   *  reading. */
  update(worldFromLink: Float64Array, wrench: FootWrench | null): void {
    const { link, sole } = this.foot;
    const at = link * 16;
    this.lowestM = Number.POSITIVE_INFINITY;
    for (let i = 0; i < this.corners.length; i += 1) {
      const corner = this.corners[i]!;
      writePoint(corner, worldFromLink, at, sole.corners[i]!);
      this.lowestM = Math.min(this.lowestM, corner[2]); // NaN wins
    }
    writePoint(this.centre, worldFromLink, at, sole.centre);
    for (let axis = 0; axis < 3; axis += 1) {
      this.rows[axis] = worldFromLink[at + 4 * axis]!;
      this.rows[3 + axis] = worldFromLink[at + 4 * axis + 1]!;
    }
    this.#takeWrench(wrench);
    if (!this.#whole || this.pressN === 0) return;
    this.#writePressure(this.#pressed);
    writePoint(this.#pushed, worldFromLink, at, this.#pressed);
    this.pushedAt = this.#pushed;
  }

  /** Sets whether it bears. A force below `leastN` has a centre of pressure that is not worth showing. */
  setBears(bears: boolean | null, leastN: number): void {
    this.bears = bears;
    this.pressure = bears === true && this.forceN !== null && this.forceN >= leastN ? this.pushedAt : null;
    this.atEdge = this.pressure !== null && isAtEdge(this.foot.sole, this.#pressed);
  }

  /** Carries the wrench to the sole's centre. */
  #takeWrench(wrench: FootWrench | null): void {
    const { sensor, sole } = this.foot;
    const force = wrench?.force.vector ?? null;
    this.forceN = this.pushedAt = null;
    this.pressN = 0;
    this.#whole = false;
    if (sensor === null || !sensor.measuresForce || force === null) return;
    writeTurned(this.#force, sensor.axes, force);
    const [nx, ny, nz] = sole.normal;
    const [fx, fy, fz] = this.#force;
    this.pressN = nx * fx + ny * fy + nz * fz;
    this.forceN = Math.abs(this.pressN);
    const moment = wrench?.moment.vector ?? null;
    if (!sensor.measuresPressure || moment === null) return;
    writeTurned(this.#moment, sensor.axes, moment);
    const rx = sensor.xyz[0] - sole.centre[0];
    const ry = sensor.xyz[1] - sole.centre[1];
    const rz = sensor.xyz[2] - sole.centre[2];
    this.#moment[0] += ry * fz - rz * fy;
    this.#moment[1] += rz * fx - rx * fz;
    this.#moment[2] += rx * fy - ry * fx;
    this.#whole = true;
  }

  /**
   * The centre of pressure in the link's frame: p = O + (n × M_O)/(f·n), with O the sole's centre (Sardain and
   * Bessonnet, "Forces Acting on a Biped Robot. Center of Pressure – Zero Moment Point", IEEE Trans. SMC-A 34, 2004).
   * It is the same whether the sensor tells the force of the floor on the foot or of the foot on the floor.
   */
  #writePressure(into: Triple): void {
    const [nx, ny, nz] = this.foot.sole.normal;
    const [mx, my, mz] = this.#moment;
    const along = this.pressN;
    const [cx, cy, cz] = this.foot.sole.centre;
    into[0] = cx + (ny * mz - nz * my) / along;
    into[1] = cy + (nz * mx - nx * mz) / along;
    into[2] = cz + (nx * my - ny * mx) / along;
  }
}

/** into ← M · p, for the transform that begins at `at` in `m`. `into` may be `p`. */
export function writePoint(into: Triple, m: Float64Array, at: number, p: Vec3): void {
  const [x, y, z] = p;
  into[0] = m[at]! * x + m[at + 4]! * y + m[at + 8]! * z + m[at + 12]!;
  into[1] = m[at + 1]! * x + m[at + 5]! * y + m[at + 9]! * z + m[at + 13]!;
  into[2] = m[at + 2]! * x + m[at + 6]! * y + m[at + 10]! * z + m[at + 14]!;
}

function writeTurned(into: Triple, [ex, ey, ez]: readonly [Vec3, Vec3, Vec3], [x, y, z]: Vec3): void {
  for (let i = 0; i < 3; i += 1) into[i] = ex[i]! * x + ey[i]! * y + ez[i]! * z;
}

/** Whether a point of the plane of its plane is less than `AT_EDGE_M` inside a sole. */
function isAtEdge({ corners, normal: [nx, ny, nz] }: SolePlane, [x, y, z]: Vec3): boolean {
  for (let i = 0; i < corners.length; i += 1) {
    const a = corners[i]!;
    const b = corners[i + 1 === corners.length ? 0 : i + 1]!;
    const [ex, ey, ez] = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    const [px, py, pz] = [x - a[0], y - a[1], z - a[2]];
    const turn = nx * (ey * pz - ez * py) + ny * (ez * px - ex * pz) + nz * (ex * py - ey * px);
    if (turn < AT_EDGE_M * Math.hypot(ex, ey, ez)) return true;
  }
  return false;
}
