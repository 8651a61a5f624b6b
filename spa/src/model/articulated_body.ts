import type { Base, JointValues, Pose } from '../twin/playback/pose.ts';
import { IDENTITY, type Quat, type Vec3, withoutHeading } from '../twin/rotation.ts';
import { type Imu, rootAttitude } from '../twin/sensors/imus.ts';
import { boundsOf, type LinkBox, lowestOf } from './bounds.ts';
import { Kinematics, placeLinks, transform } from './kinematics.ts';
import { boxesOfLinks, type Manifest } from './manifest.ts';
import type { BodyJoint, PlacedBox } from './posed_body.ts';
import { quatOfTransform } from './vectors.ts';

const MOVES: ReadonlySet<string> = new Set(['revolute', 'continuous', 'prismatic']);

/** A transform: 16 numbers, column-major, a view into a larger array. */
export interface PlacedLink {
  readonly matrixWorld: { readonly elements: Float64Array };
}

/** The manifest's links and joints, forward kinematics for the links, and their places in the world. The robots of both renderers
 *  extend it. */
export class ArticulatedBody {
  readonly manifest: Manifest;
  readonly linkNames: readonly string[];
  /** Joints that can move. */
  readonly jointNames: readonly string[];
  readonly continuousNames: readonly string[];
  /** Bounding box (in the link's frame, metres) of each link's visuals, by the link's index in the manifest. */
  readonly boxOfLink: Map<number, LinkBox>;
  /** The same with the link's pose in the world. */
  readonly boxes: PlacedBox[];
  /** world_from_link of the newest `place` or `ground`: 16 numbers a link, column-major, metres. Link 0 is the root. */
  readonly worldFromLink: Float64Array;
  protected readonly kinematics: Kinematics;
  /** The index in the manifest of each link. */
  protected readonly linkOf: ReadonlyMap<string, number>;
  /** By the link's index in the manifest; views into `worldFromLink`. */
  protected readonly placed: readonly PlacedLink[];
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
    this.worldFromLink = new Float64Array(links.length * 16);
    this.placed = links.map((_, i) => ({
      matrixWorld: { elements: this.worldFromLink.subarray(i * 16, i * 16 + 16) },
    }));
    this.boxOfLink = boxesOfLinks(manifest);
    this.boxes = [...this.boxOfLink].map(([link, box]) => [this.placed[link]!, box]);
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

  linkMatrix(name: string): PlacedLink['matrixWorld'] | undefined {
    return this.placed[this.linkOf.get(name) ?? -1]?.matrixWorld;
  }

  /** Places the root link in the world (metres, unit quaternion), and all links with it. */
  place(xyz: Vec3, quat_wxyz: Quat): void {
    placeLinks(transform(xyz, quat_wxyz), this.kinematics.rootFromLink, this.worldFromLink);
  }

  /** Puts the root over the world's origin with this rotation (default upright), the lowest point on the floor. */
  ground(quat_wxyz: Quat = IDENTITY): void {
    this.place([0, 0, -this.#lowestPoint(quat_wxyz)], quat_wxyz);
  }

  /** The bounding box (world, metres) of all link boxes and link origins. */
  bounds(): LinkBox {
    return boundsOf(this.worldFromLink, this.boxOfLink);
  }

  /** The lowest z (metres, from the root's origin) of the robot with this root orientation. */
  #lowestPoint(quat_wxyz: Quat): number {
    placeLinks(transform([0, 0, 0], quat_wxyz), this.kinematics.rootFromLink, this.#turned);
    return lowestOf(this.#turned, this.boxOfLink);
  }
}

/** The pose of a robot's root link in the world: from its odometry, else from its body's IMU, else upright. Readings that are not
 *  finite are ignored. */
export class RootPose {
  #headingLocked = false;
  /** The newest valid base; null while the robot reports none. */
  #base: Base | null = null;
  #lean: Imu | null = null;
  /** world_from_root from the last reading of the body's IMU; null before the first. */
  #leaned: Quat | null = null;

  /** Takes the newest pose. True if the root may have moved. */
  update({ base, lean = null }: Pose): boolean {
    const based = this.#takeBase(base);
    const before = this.#lean?.worldFromSensor ?? null;
    this.#lean = lean;
    return based || (lean?.worldFromSensor?.some((part, i) => part !== before?.[i]) ?? false);
  }

  /** Sets whether the robot always faces along the world's x axis. True if that is a change. */
  lockHeading(locked: boolean): boolean {
    const changed = locked !== this.#headingLocked;
    this.#headingLocked = locked;
    return changed;
  }

  /** world_from_root. `xyz` is null if the robot should stand on its lowest point. `rootTurn` gives a link's rotation for the
   *  joint angles, or null for a link that the model lacks. */
  root(rootTurn: (link: string) => Quat | null): { xyz: Vec3 | null; quat_wxyz: Quat } {
    const { xyz, quat_wxyz } = this.#base ?? { xyz: null, quat_wxyz: this.#attitude(rootTurn) };
    return { xyz, quat_wxyz: this.#headingLocked ? withoutHeading(quat_wxyz) : quat_wxyz };
  }

  /** The orientation from the IMU's last reading; upright without one. */
  #attitude(rootTurn: (link: string) => Quat | null): Quat {
    const imu = this.#lean;
    const rootFromLink = imu === null ? null : imu.link === null ? IDENTITY : rootTurn(imu.link);
    if (imu === null || rootFromLink === null) return IDENTITY;
    this.#leaned = rootAttitude(imu, rootFromLink) ?? this.#leaned;
    return this.#leaned ?? IDENTITY;
  }

  /** Takes a base; one that is not finite is ignored, and the last one is kept. True if the base changed. */
  #takeBase(base: Base | null): boolean {
    const old = this.#base;
    if (base === null) {
      this.#base = null;
      return old !== null;
    }
    const now = [...base.xyz, ...base.quat_wxyz];
    if (!now.every(Number.isFinite) || Math.hypot(...base.quat_wxyz) < 1e-6) return false;
    if (old !== null && [...old.xyz, ...old.quat_wxyz].every((value, i) => value === now[i])) return false;
    this.#base = base;
    return true;
  }
}
