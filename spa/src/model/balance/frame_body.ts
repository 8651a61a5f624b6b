import type { Schema } from '@posecast/wire';
import { type Pose, Poser } from '../../twin/playback/pose.ts';
import { ImuTable } from '../../twin/sensors/imus.ts';
import { ArticulatedBody } from '../articulated_body.ts';
import { placeLinks, transform } from '../kinematics.ts';
import type { Manifest } from '../manifest.ts';
import { RootPose } from '../root_pose.ts';

/** A robot's body placed from a frame's codes alone, the same way as the scene places it: by odometry, or else standing on its
 *  lowest point with the IMU's orientation. Joints without a reading stay at their last known position. */
export class FrameBody extends ArticulatedBody {
  /** 16 numbers a link, column-major, metres; overwritten by `place`. */
  readonly worldFromLink: Float64Array;
  readonly #poser: Poser;
  readonly #imus: ImuTable;
  readonly #root = new RootPose();

  constructor(manifest: Manifest, schema: Schema) {
    super(manifest);
    this.worldFromLink = new Float64Array(manifest.links.length * 16);
    this.#poser = new Poser(schema, 'pos');
    this.#imus = new ImuTable(schema);
  }

  /** Updates `worldFromLink`, and returns the frame's data about the body. */
  place(codes: Int32Array): Pose {
    this.#imus.read(codes);
    const pose = this.#poser.pose(codes, this.#imus.body);
    this.setJoints(pose.joints);
    this.#root.update(pose);
    const { xyz, quat_wxyz } = this.#root.root((link) => this.rootTurn(link));
    const stands = xyz ?? ([0, 0, -this.lowestPoint(quat_wxyz)] as const);
    placeLinks(transform(stands, quat_wxyz), this.kinematics.rootFromLink, this.worldFromLink);
    return pose;
  }
}
