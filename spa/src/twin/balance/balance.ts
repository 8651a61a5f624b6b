import type { Ground } from '@posecast/wire';
import type { Vec3 } from '../rotation.ts';

/** A point on the floor: x and y in the world frame, metres. */
export type Vec2 = readonly [x: number, y: number];

/** A motion of the floor under a robot, in the world of the scene, metres. */
export type Slide = (before: Vec3) => Vec3;

/**
 * Why a part of the balance is null.
 *
 * - `old-bundle`: the model was built by a builder that did not write it; building it again brings it.
 * - `raw`: the model is shown from its files as they are, and the page finds no soles in these.
 * - `no-masses`: the robot's description has no masses.
 * - `impossible-masses`: it has masses that can't be; the model's findings name them.
 * - `no-feet`: nothing is known that the robot stands on (an arm, wheels, a stand).
 * - `no-wrench`: its feet measure no force, or too few components of it.
 * - `unread`: a foot measures its force, but has no reading now.
 * - `orientation-unread`: what tells how the body is turned has no reading now.
 * - `joint-unread`: a joint that carries weight has no reading now.
 * - `airborne`: no foot bears weight.
 * - `first-pose`: a velocity takes two poses that share a foot that bears.
 */
export type BalanceGap =
  | 'old-bundle'
  | 'raw'
  | 'no-masses'
  | 'impossible-masses'
  | 'no-feet'
  | 'no-wrench'
  | 'unread'
  | 'orientation-unread'
  | 'joint-unread'
  | 'airborne'
  | 'first-pose';

/** One foot: where its sole is, whether it bears, and where the floor pushes against it. */
export interface FootBalance {
  /** The site of its wrench sensor, or its link. */
  readonly name: string;
  /** The link of the model that has the sole. */
  readonly link: string;
  /** Whether it bears weight; null: its sensor has no reading. */
  readonly bears: boolean | null;
  /** The size of the force along the sole's normal, N; null: not measured, or no reading. */
  readonly forceN: number | null;
  /** The centre of pressure on the sole (world, metres); null: it does not bear, or the sensor measures too little. */
  readonly pressure: Vec3 | null;
  /** Whether that is on the sole's edge (at most 5 mm inside, or outside): the foot begins to tip. */
  readonly atEdge: boolean;
  /** The sole's corners (world, metres), at least three, counter-clockwise about `normal`: seen from above while the foot is
   *  level. */
  readonly corners: readonly Vec3[];
  /** A unit vector, world. */
  readonly normal: Vec3;
}

/**
 * What a robot stands on and where its mass is, in one pose. Lengths are metres in the world frame of the scene (z up,
 * see `RootPose`). A reader of balance rewrites its members with every pose, but not what they are.
 */
export interface Balance {
  /** Mass of all links, kg; 0 when no masses are known. */
  readonly massKg: number;
  /** Σ m·p / Σ m over all links. */
  readonly centreOfMass: Vec3 | null;
  /** Velocity of the centre of mass, m/s: relative to a foot that bears, and smoothed (see `CentreVelocity`). */
  readonly velocity: Vec3 | null;
  /** Takes a point of the floor in the pose before to where it is now, by the foot that velocity is relative to: a robot without
   *  odometry stays where it is in the scene, and the floor moves under it. null: no foot bears in both poses. */
  readonly slide: Slide | null;
  /** Where the robot would have to step to come to rest, on the floor: x + ẋ·√(z/g) (Pratt et al., 2006). */
  readonly capturePoint: Vec3 | null;
  /** Height of the floor: of the lowest corner of the soles that bear; null when none bears. */
  readonly floorM: number | null;
  /** How it is known which feet bear: `measured` by the force along their soles' normals (from 5 % of the weight on,
   *  until it is below 3 %), or `lowest`, assumed of all soles whose lowest corner is within 10 mm of the lowest one's.
   *  null: no feet are known. */
  readonly ground: Ground | null;
  /** The support polygon: convex hull of the bearing soles' corners, counter-clockwise; [] for none. */
  readonly polygon: readonly Vec2[];
  /** The index in `polygon` of the corner where the edge that is nearest to the centre of mass begins. */
  readonly nearestEdge: number | null;
  /** Distance from the centre of mass' foot on the floor to the nearest edge; positive inside, negative outside. */
  readonly marginM: number | null;
  /** The centre of pressure of all feet that bear, on the floor. */
  readonly pressure: Vec3 | null;
  /** The feet in the order of the profile, else of the sensors or soles; [] for none. */
  readonly feet: readonly FootBalance[];
  /** Why something is null; null for what is there. */
  readonly gaps: {
    readonly centreOfMass: BalanceGap | null;
    /** Of the polygon and the floor. */
    readonly polygon: BalanceGap | null;
    readonly margin: BalanceGap | null;
    readonly pressure: BalanceGap | null;
    readonly capturePoint: BalanceGap | null;
  };
}
