import type { Schema } from '@posecast/wire';
import { ArticulatedBody } from '../../../model/articulated_body.ts';
import { multiply } from '../../../model/kinematics.ts';
import type { Manifest } from '../../../model/manifest.ts';
import { RootPose } from '../../../model/root_pose.ts';
import { quatOfTransform } from '../../../model/vectors.ts';
import { type Base, Poser } from '../../../twin/playback/pose.ts';
import type { Quat } from '../../../twin/rotation.ts';
import { ImuTable } from '../../../twin/sensors/imus.ts';
import { type CdrWriter, utf8Of } from './cdr_writer.ts';
import { writeHeader } from './stamp.ts';

/** The suffix for a link with the same name as the first one. */
const WORLDS = ['world', 'posecast_world'] as const;

/** The links of a model as transforms, each relative to its parent, and the root relative to `world`: the same places as on the
 *  page. A joint or base without a reading keeps its last known value, and so does the orientation from the body's IMU. */
export class LinkFrames {
  readonly #body: SavedBody;
  readonly #root = new RootPose();
  readonly #links: readonly {
    readonly parent: number;
    readonly frame: Uint8Array;
    readonly link: Uint8Array;
  }[];
  /** The root's frame of reference, as UTF-8. */
  readonly #world: Uint8Array;
  readonly #parentFromLink = new Float64Array(16);
  #readers: { readonly schema: Schema; readonly poser: Poser; readonly imus: ImuTable } | null = null;
  #base: Base | null = null;
  /** The last reading of the body's IMU. */
  #worldFromSensor: Quat | null = null;

  constructor(manifest: Manifest) {
    this.#body = new SavedBody(manifest);
    const { links, joints } = manifest;
    this.#world = utf8Of(links.includes(WORLDS[0]) ? WORLDS[1] : WORLDS[0]);
    this.#links = joints.map(({ parent }, i) => ({
      parent,
      frame: utf8Of(links[parent]!),
      link: utf8Of(links[i + 1]!),
    }));
  }

  get rootLink(): string {
    return this.#body.linkNames[0]!;
  }

  /** Writes a tf2_msgs/msg/TFMessage. `atUs`: unix. */
  write(to: CdrWriter, atUs: number, schema: Schema, codes: Int32Array): void {
    const [x, y, z, ...turn] = this.#place(schema, codes);
    to.begin();
    to.u32(1 + this.#links.length);
    writeHeader(to, atUs, this.#world);
    to.text(this.rootLink);
    for (const value of [x, y, z]) to.f64(value);
    writeTurn(to, turn);
    this.#links.forEach(({ parent, frame, link }, i) => {
      this.#body.writeRelative(this.#parentFromLink, parent, i + 1);
      writeHeader(to, atUs, frame);
      to.utf8(link);
      for (let k = 12; k < 15; k++) to.f64(this.#parentFromLink[k]!);
      writeTurn(to, quatOfTransform(this.#parentFromLink));
    });
  }

  /** Poses the body. Returns world_from_root: metres, and a unit quaternion w, x, y, z. */
  #place(schema: Schema, codes: Int32Array): readonly [number, number, number, ...Quat] {
    if (this.#readers?.schema !== schema) {
      this.#readers = { schema, poser: new Poser(schema, 'pos'), imus: new ImuTable(schema) };
      this.#base = null;
      this.#worldFromSensor = null;
    }
    const { poser, imus } = this.#readers;
    imus.read(codes);
    const pose = poser.pose(codes);
    this.#body.setJoints(pose.joints);
    this.#base = pose.base ?? this.#base;
    this.#worldFromSensor = imus.body?.worldFromSensor ?? this.#worldFromSensor;
    const lean = imus.body === null ? null : { ...imus.body, worldFromSensor: this.#worldFromSensor };
    this.#root.update({ ...pose, base: this.#base, lean });
    const { xyz, quat_wxyz } = this.#root.root((link) => this.#body.rootTurn(link));
    const [x, y, z] = xyz ?? [0, 0, -this.#body.lowest(quat_wxyz)];
    return [x, y, z, ...quat_wxyz];
  }
}

function writeTurn(to: CdrWriter, [w, x, y, z]: Quat): void {
  for (const value of [x, y, z, w]) to.f64(value);
}

/** A body that is posed but not drawn. */
class SavedBody extends ArticulatedBody {
  readonly #inverse = new Float64Array(16);

  /** The lowest z (metres, from the root's origin) for this root orientation. */
  lowest(quat_wxyz: Quat): number {
    return this.lowestPoint(quat_wxyz);
  }

  /** Writes parent_from_link. */
  writeRelative(into: Float64Array, parent: number, link: number): void {
    const { rootFromLink } = this.kinematics;
    invertRigid(this.#inverse, rootFromLink, parent * 16);
    multiply(into, 0, this.#inverse, 0, rootFromLink, link * 16);
  }
}

/** out ← the inverse of a transform without scale, the 16 numbers from index `at` on. */
function invertRigid(out: Float64Array, m: Float64Array, at: number): void {
  for (let row = 0; row < 3; row++) {
    for (let column = 0; column < 3; column++) out[4 * column + row] = m[at + 4 * row + column]!;
    out[12 + row] = -(
      m[at + 4 * row]! * m[at + 12]! +
      m[at + 4 * row + 1]! * m[at + 13]! +
      m[at + 4 * row + 2]! * m[at + 14]!
    );
  }
  out[15] = 1;
}
