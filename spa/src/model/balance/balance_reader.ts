import type { Schema } from '@posecast/wire';
import type { Balance, FootWrench, Standing } from '../../twin/balance/balance.ts';
import { Balancer } from '../../twin/balance/balancer.ts';
import { FootWrenchReader } from '../../twin/balance/foot_wrench.ts';
import { type Pose, Poser, whyUnknown } from '../../twin/playback/pose.ts';
import { ImuTable } from '../../twin/sensors/imus.ts';
import { ArticulatedBody, RootPose } from '../articulated_body.ts';
import { jointsThatCarry } from '../kinematics.ts';
import type { Manifest } from '../manifest.ts';
import type { PosedBody } from '../posed_body.ts';
import { chooseStanding } from './standing_choice.ts';

/** A robot's body placed from a frame's codes alone, the same way as the scene places it: by odometry, or else standing on its
 *  lowest point with the IMU's orientation. Joints without a reading stay at their last known position. */
export class FrameBody extends ArticulatedBody {
  readonly #poser: Poser;
  readonly #imus: ImuTable;
  readonly #root = new RootPose();

  constructor(manifest: Manifest, schema: Schema) {
    super(manifest);
    this.#poser = new Poser(schema, 'pos');
    this.#imus = new ImuTable(schema);
  }

  /** Places it by a frame, and returns the frame's data about the body. */
  follow(codes: Int32Array): Pose {
    this.#imus.read(codes);
    const pose = this.#poser.pose(codes, this.#imus.body);
    this.setJoints(pose.joints);
    this.#root.update(pose);
    const { xyz, quat_wxyz } = this.#root.root((link) => this.rootTurn(link));
    if (xyz === null) this.ground(quat_wxyz);
    else this.place(xyz, quat_wxyz);
    return pose;
  }
}

/** What a body must provide about its links. */
type LinkedBody = Pick<PosedBody, 'linkMatrix'>;

/** The parts of a pose that have no reading. */
type Lacks = Pick<Pose, 'unturned' | 'unread'>;

/**
 * Computes a robot's balance pose by pose, from the codes of frames or from a displayed body. Poses must come in time order,
 * because a reader keeps state: which feet bear weight, and the velocity. A new schema or model needs a new reader.
 */
export class BalanceReader {
  readonly manifest: Manifest;
  readonly schema: Schema;
  readonly #standing: Standing;
  readonly #balancer: Balancer;
  /** The joints that move a foot or at least 1 % of the mass. */
  readonly #carriers: readonly string[];
  readonly #wrenches: FootWrenchReader;
  #body: FrameBody | null = null;
  /** world_from_link of all links of a displayed body. */
  readonly #worldFromLink: Float64Array;

  constructor(manifest: Manifest, schema: Schema) {
    this.manifest = manifest;
    this.schema = schema;
    this.#standing = chooseStanding(manifest, schema);
    this.#balancer = new Balancer(this.#standing);
    const { masses, feet } = this.#standing;
    const sites = feet.flatMap(({ sensor }) => sensor?.site ?? []);
    this.#carriers = jointsThatCarry(manifest.joints, masses, feet);
    this.#wrenches = new FootWrenchReader(schema, sites);
    this.#worldFromLink = new Float64Array(manifest.links.length * 16);
  }

  /** Whether the page shows balance by default: the robot has masses, and two feet with wrenches. */
  get onByItself(): boolean {
    const { massGap, feet } = this.#standing;
    return massGap === null && feet.filter(({ sensor }) => sensor?.measuresForce).length >= 2;
  }

  /** Whether there is anything to show: masses or feet. */
  get hasAny(): boolean {
    return this.#standing.massGap === null || this.#standing.feet.length > 0;
  }

  /** The parts of the model or profile that could not be read, one line each. */
  get problems(): readonly string[] {
    return this.#standing.problems;
  }

  /** The heading of the body in the newest frame, rad from the world's x axis: from odometry, else from the sensor of the body's
   *  orientation, else along the world's x axis. */
  get headingRad(): number {
    const [ahead = 1, left = 0] = this.#body?.worldFromLink ?? [];
    return Math.atan2(left, ahead) || 0; // NaN while unknown
  }

  /** The wrenches of the feet in a frame's codes, in N and N·m. Overwritten by the next call. */
  wrenches(codes: Int32Array): readonly FootWrench[] {
    return this.#wrenches.read(codes);
  }

  /** The wrenches of the feet of a displayed pose, in N and N·m, from those in their channels' units. Overwritten by the next
   *  call. */
  wrenchesOf(played: readonly FootWrench[]): readonly FootWrench[] {
    return this.#wrenches.convert(played);
  }

  /** The balance of a frame (for text, limits and plots). `tS` is the robot's time, seconds. The result is overwritten by the
   *  next call. */
  ofFrame(codes: Int32Array, tS: number): Balance {
    this.#body ??= new FrameBody(this.manifest, this.schema);
    const pose = this.#body.follow(codes);
    return this.#update(this.#body.worldFromLink, this.wrenches(codes), tS, pose);
  }

  /** The balance of a displayed body (for signs), with the wrenches of the same moment. `tS` is the time of the displayed pose,
   *  seconds; `lacks`: the parts of that pose without a reading. The result is overwritten by the next call. */
  ofBody(body: LinkedBody, wrenches: readonly FootWrench[], tS: number, lacks: Lacks = {}): Balance {
    this.#worldFromLink.fill(Number.NaN);
    this.manifest.links.forEach((link, i) => {
      this.#worldFromLink.set(body.linkMatrix(link)?.elements ?? [], i * 16);
    });
    return this.#update(this.#worldFromLink, wrenches, tS, lacks);
  }

  #update(worldFromLink: Float64Array, wrenches: readonly FootWrench[], tS: number, lacks: Lacks): Balance {
    const blind = whyUnknown(lacks, this.#carriers);
    if (blind !== undefined) worldFromLink.fill(Number.NaN); // their positions are unknown
    this.#balancer.update(worldFromLink, wrenches, tS, blind);
    return this.#balancer;
  }
}
