import type { JointValues } from '../twin/playback/pose.ts';
import type { Quat } from '../twin/rotation.ts';
import { type LinkBox, lowestOf } from './bounds.ts';
import { Kinematics, placeLinks, transform } from './kinematics.ts';
import { boxesOfLinks, type Manifest } from './manifest.ts';
import type { BodyJoint } from './posed_body.ts';
import { quatOfTransform } from './vectors.ts';

const MOVES: ReadonlySet<string> = new Set(['revolute', 'continuous', 'prismatic']);

/** The manifest's links and joints, and forward kinematics for the links. The robots of both renderers extend it. */
export class ArticulatedBody {
  readonly manifest: Manifest;
  readonly linkNames: readonly string[];
  /** Joints that can move. */
  readonly jointNames: readonly string[];
  readonly continuousNames: readonly string[];
  /** Bounding box (in the link's frame, metres) of each link's visuals, by the link's index in the manifest. */
  readonly boxOfLink: Map<number, LinkBox>;
  protected readonly kinematics: Kinematics;
  /** The index in the manifest of each link. */
  protected readonly linkOf: ReadonlyMap<string, number>;
  readonly #jointOf: ReadonlyMap<string, number>;
  readonly #turned: Float64Array;

  constructor(manifest: Manifest) {
    const { links, joints } = manifest;
    this.manifest = manifest;
    this.kinematics = new Kinematics(joints);
    this.linkNames = links;
    this.jointNames = this.kinematics.jointNames;
    this.continuousNames = joints.filter(({ type }) => type === 'continuous').map(({ name }) => name);
    this.#turned = new Float64Array(links.length * 16);
    this.boxOfLink = boxesOfLinks(manifest);
    this.linkOf = new Map(links.map((name, i) => [name, i]));
    this.#jointOf = new Map(joints.flatMap(({ name, type }, i) => (MOVES.has(type) ? [[name, i]] : [])));
  }

  /** The rotation of root_from_link given the joint angles; null for a link that the model lacks. */
  rootTurn(name: string): Quat | null {
    const link = this.linkOf.get(name);
    if (link === undefined) return null;
    return quatOfTransform(this.kinematics.rootFromLink.subarray(link * 16, link * 16 + 16));
  }

  /** A joint by name; undefined for one that cannot move or that the model lacks. */
  joint(name: string): BodyJoint | undefined {
    const found = this.#jointOf.get(name);
    if (found === undefined) return undefined;
    const { axis, type } = this.manifest.joints[found]!;
    return { link: this.linkNames[found + 1]!, axis, slides: type === 'prismatic' };
  }

  /** A joint's position, rad or m; null for one that cannot move or that the model lacks. */
  jointValue(name: string): number | null {
    const found = this.#jointOf.get(name);
    return found === undefined ? null : this.kinematics.value(found);
  }

  /** Bounding box of what the link shows, in its own frame, metres. */
  linkBox(name: string): LinkBox | undefined {
    return this.boxOfLink.get(this.linkOf.get(name) ?? -1);
  }

  /** For each link but the root: its parent link's name and its own. */
  *bones(): Generator<[parent: string, child: string]> {
    for (const [i, { parent }] of this.manifest.joints.entries()) {
      yield [this.linkNames[parent]!, this.linkNames[i + 1]!];
    }
  }

  /** Sets joints and computes the link poses. False if nothing changed. */
  setJoints(joints: JointValues): boolean {
    if (!this.kinematics.set(joints)) return false;
    this.kinematics.compute();
    return true;
  }

  /** The lowest z (metres, from the root's origin) of the robot with this root orientation. */
  protected lowestPoint(quat_wxyz: Quat): number {
    placeLinks(transform([0, 0, 0], quat_wxyz), this.kinematics.rootFromLink, this.#turned);
    return lowestOf(this.#turned, this.boxOfLink);
  }
}
