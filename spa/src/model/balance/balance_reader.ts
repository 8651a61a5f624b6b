import type { Schema } from '@posecast/wire';
import type { Balance } from '../../twin/balance/balance.ts';
import { Balancer } from '../../twin/balance/balancer.ts';
import { FootWrenchReader } from '../../twin/balance/foot_wrench.ts';
import type { FootWrench, Standing } from '../../twin/balance/standing.ts';
import { type Pose, whyUnknown } from '../../twin/playback/pose.ts';
import { jointsThatCarry } from '../kinematics.ts';
import type { Manifest } from '../manifest.ts';
import type { PosedBody } from '../posed_body.ts';
import { FrameBody } from './frame_body.ts';
import { chooseStanding } from './standing_choice.ts';

/** What a body must tell of its links. */
type LinkedBody = Pick<PosedBody, 'linkMatrix'>;

/** What of a pose has no reading. */
type Lacks = Pick<Pose, 'unturned' | 'unread'>;

/**
 * Reads a robot's balance pose by pose, from frames' codes or from a body that is shown. One reader serves one course of
 * poses in the order of time: it keeps which feet bear, and the velocity. A new schema or model needs a new reader.
 */
export class BalanceReader {
  readonly manifest: Manifest;
  readonly schema: Schema;
  readonly #standing: Standing;
  readonly #balancer: Balancer;
  /** The joints beyond which a foot is, or 1 % of the mass. */
  readonly #carriers: readonly string[];
  readonly #wrenches: FootWrenchReader;
  #body: FrameBody | null = null;
  /** world_from_link of all links of a body that is shown. */
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

  /** Whether the page shows balance unless told otherwise: it has masses, and two feet with wrenches. */
  get onByItself(): boolean {
    const { massGap, feet } = this.#standing;
    return massGap === null && feet.filter(({ sensor }) => sensor?.measuresForce).length >= 2;
  }

  /** Whether there is anything to show: masses, or feet. */
  get hasAny(): boolean {
    return this.#standing.massGap === null || this.#standing.feet.length > 0;
  }

  /** What of the model or the profile could not be read, a line each. */
  get problems(): readonly string[] {
    return this.#standing.problems;
  }

  /** Where the body of the newest frame faces, rad from the world's x: by its odometry, else by the sensor that says how
   *  its body is turned, else along the world's x. */
  get headingRad(): number {
    const [ahead = 1, left = 0] = this.#body?.worldFromLink ?? [];
    return Math.atan2(left, ahead) || 0; // NaN while nobody knows
  }

  /** The wrenches of the feet in a frame's codes, in N and N·m. They are rewritten by the next call. */
  wrenches(codes: Int32Array): readonly FootWrench[] {
    return this.#wrenches.read(codes);
  }

  /** The wrenches of the feet of a pose that is shown, in N and N·m, from those in their channels' units. They are rewritten by
   *  the next call. */
  wrenchesOf(played: readonly FootWrench[]): readonly FootWrench[] {
    return this.#wrenches.convert(played);
  }

  /** The balance of a frame (for words, limits and plots). `tS` is the robot's time, seconds. The result is rewritten by
   *  the next call. */
  ofFrame(codes: Int32Array, tS: number): Balance {
    this.#body ??= new FrameBody(this.manifest, this.schema);
    const pose = this.#body.place(codes);
    return this.#update(this.#body.worldFromLink, this.wrenches(codes), tS, pose);
  }

  /** The balance of a body as it is shown (for signs), with the wrenches of the same moment. `tS` is the time of the pose
   *  that is shown, seconds; `lacks`: what of that pose has no reading. The result is rewritten by the next call. */
  ofBody(body: LinkedBody, wrenches: readonly FootWrench[], tS: number, lacks: Lacks = {}): Balance {
    this.#worldFromLink.fill(Number.NaN);
    this.manifest.links.forEach((link, i) => {
      this.#worldFromLink.set(body.linkMatrix(link)?.elements ?? [], i * 16);
    });
    return this.#update(this.#worldFromLink, wrenches, tS, lacks);
  }

  #update(worldFromLink: Float64Array, wrenches: readonly FootWrench[], tS: number, lacks: Lacks): Balance {
    const blind = whyUnknown(lacks, this.#carriers);
    if (blind !== undefined) worldFromLink.fill(Number.NaN); // nobody knows where they are
    this.#balancer.update(worldFromLink, wrenches, tS, blind);
    return this.#balancer;
  }
}
