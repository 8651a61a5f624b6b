import { JointMapping, type Schema } from '@posecast/wire';
import { baseOf } from '../../twin/playback/pose.ts';
import { ImuTable } from '../../twin/sensors/imus.ts';
import { ArticulatedBody } from '../articulated_body.ts';
import { placeLinks, transform } from '../kinematics.ts';
import type { Manifest } from '../manifest.ts';
import { RootPose } from '../root_pose.ts';

/** A robot's body placed by a frame's codes alone, as the scene places it: by odometry, else standing on its lowest
 *  point as its IMU says. What has no reading stays where it was last known. */
export class FrameBody extends ArticulatedBody {
  /** 16 numbers a link, column-major, metres; rewritten by `place`. */
  readonly worldFromLink: Float64Array;
  readonly #schema: Schema;
  readonly #mapping: JointMapping;
  readonly #imus: ImuTable;
  readonly #root = new RootPose();
  /** The newest readings, rad or m by URDF joint. */
  readonly #readings = new Map<string, number>();
  readonly #rootTurn = (link: string) => this.rootTurn(link);

  constructor(manifest: Manifest, schema: Schema) {
    super(manifest);
    this.worldFromLink = new Float64Array(manifest.links.length * 16);
    this.#schema = schema;
    this.#mapping = new JointMapping(schema, 'pos');
    this.#imus = new ImuTable(schema);
  }

  /** Rewrites `worldFromLink`. */
  place(codes: Int32Array): void {
    const values = this.#mapping.evaluate(codes);
    const { joints } = this.#mapping;
    for (let i = 0; i < joints.length; i += 1) {
      if (Number.isFinite(values[i])) this.#readings.set(joints[i]!, values[i]!);
    }
    this.setJoints(this.#readings);
    this.#imus.read(codes);
    this.#root.update({ joints: this.#readings, base: baseOf(this.#schema, codes), lean: this.#imus.body });
    const { xyz, quat_wxyz } = this.#root.root(this.#rootTurn);
    const stands = xyz ?? ([0, 0, -this.lowestPoint(quat_wxyz)] as const);
    placeLinks(transform(stands, quat_wxyz), this.kinematics.rootFromLink, this.worldFromLink);
  }
}
