import type { Ground } from '@posecast/wire';
import type { Vec3 } from '../rotation.ts';

/** A point on the floor: x and y in the world frame, metres. */
export type Vec2 = readonly [x: number, y: number];

/** The motion of the floor relative to a robot, in the scene's world, metres. */
export type Slide = (before: Vec3) => Vec3;

/**
 * Why a part of the balance is null.
 *
 * - `old-bundle`: the model was built by an older builder that did not write it; rebuild the model.
 * - `raw`: the model is shown from its raw files, and the page does not find soles in them.
 * - `no-masses`: the robot's description has no masses.
 * - `impossible-masses`: it has implausible masses; the model's findings name them.
 * - `no-feet`: it is unknown what the robot stands on (an arm, wheels, a stand).
 * - `no-wrench`: its feet measure no force, or too few components of it.
 * - `unread`: a foot measures its force, but has no reading now.
 * - `orientation-unread`: the sensor of the body's orientation has no reading now.
 * - `joint-unread`: a joint that carries weight has no reading now.
 * - `airborne`: no foot bears weight.
 * - `first-pose`: a velocity needs two poses with a common foot that bears weight.
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

/** One foot: its sole, whether it bears weight, and its centre of pressure. */
export interface FootBalance {
  /** The site of its wrench sensor, or its link. */
  readonly name: string;
  /** The link of the model that has the sole. */
  readonly link: string;
  /** Whether it bears weight; null: its sensor has no reading. */
  readonly bears: boolean | null;
  /** The force along the sole's normal, N; null: not measured, or no reading. */
  readonly forceN: number | null;
  /** The centre of pressure on the sole (world, metres); null: it bears no weight, or the sensor measures too little. */
  readonly pressure: Vec3 | null;
  /** Whether that is on the sole's edge (at most 5 mm inside, or outside): the foot is about to tip. */
  readonly atEdge: boolean;
  /** The sole's corners (world, metres), at least three, counter-clockwise about `normal`: seen from above while the foot is
   *  level. */
  readonly corners: readonly Vec3[];
  /** A unit vector, world. */
  readonly normal: Vec3;
}

/**
 * A robot's support and centre of mass in one pose. Lengths are metres in the scene's world frame (z up, see `RootPose`). A
 * balance reader overwrites the members with every pose, but not the objects that they refer to.
 */
export interface Balance {
  /** Mass of all links, kg; 0 if no masses are known. */
  readonly massKg: number;
  /** Σ m·p / Σ m over all links. */
  readonly centreOfMass: Vec3 | null;
  /** Velocity of the centre of mass, m/s: relative to a foot that bears weight, and smoothed (see `CentreVelocity`). */
  readonly velocity: Vec3 | null;
  /** Maps a floor point from the previous pose to the current one, using the foot that the velocity is relative to: a robot
   *  without odometry stays in place in the scene, and the floor moves under it. null: no foot bears weight in both poses. */
  readonly slide: Slide | null;
  /** The point on the floor where the robot would have to step to come to rest: x + ẋ·√(z/g) (Pratt et al., 2006). */
  readonly capturePoint: Vec3 | null;
  /** Height of the floor: that of the lowest corner of the weight-bearing soles; null if none bears weight. */
  readonly floorM: number | null;
  /** How it is known which feet bear weight. `measured`: by the force along their soles' normals (from 5 % of the weight on,
   *  until it drops below 3 %). `lowest`: assumed for all soles whose lowest corner is within 10 mm of the lowest one. null: no
   *  feet are known. */
  readonly ground: Ground | null;
  /** The support polygon: the convex hull of the weight-bearing soles' corners, counter-clockwise; [] for none. */
  readonly polygon: readonly Vec2[];
  /** The index in `polygon` of the corner at which the edge nearest to the centre of mass begins. */
  readonly nearestEdge: number | null;
  /** Distance from the projected centre of mass to the nearest edge; positive inside, negative outside. */
  readonly marginM: number | null;
  /** The common centre of pressure of all weight-bearing feet, on the floor. */
  readonly pressure: Vec3 | null;
  /** The feet in the order of the profile, else of the sensors or soles; [] for none. */
  readonly feet: readonly FootBalance[];
  /** Why each null value is missing; null for values that exist. */
  readonly gaps: {
    readonly centreOfMass: BalanceGap | null;
    /** For the polygon and the floor. */
    readonly polygon: BalanceGap | null;
    readonly margin: BalanceGap | null;
    readonly pressure: BalanceGap | null;
    readonly capturePoint: BalanceGap | null;
  };
}

/** The mass of one link. */
export interface MassPoint {
  /** Index of the link. */
  readonly link: number;
  readonly massKg: number;
  /** Centre of mass in the link's frame, metres. */
  readonly xyz: Vec3;
}

/** The sole of a foot as used in the computation, in the frame of the link that has the sole, metres. */
export interface SolePlane {
  /** A convex polygon, counter-clockwise about `normal`. */
  readonly corners: readonly Vec3[];
  /** A unit vector that points into the foot. */
  readonly normal: Vec3;
  /** The mean of the corners, in the plane. */
  readonly centre: Vec3;
}

/** The parts of a wrench that balance needs; `WrenchTable` provides them. */
export interface FootWrench {
  readonly site: string;
  /** N in the sensor's axes; null without a reading. `axes`: the measured ones (0 x, 1 y, 2 z). */
  readonly force: { readonly vector: Vec3 | null; readonly axes: readonly number[] };
  /** N·m, likewise. */
  readonly moment: { readonly vector: Vec3 | null; readonly axes: readonly number[] };
}

/** A force-torque sensor above a sole, in the frame of the link that has the sole. */
export interface FootSensor {
  readonly site: string;
  /** sole_from_sensor: its place (m), and its axes x, y, z as unit vectors. */
  readonly xyz: Vec3;
  readonly axes: readonly [Vec3, Vec3, Vec3];
  /** Whether it measures the axis nearest to the sole's normal. */
  readonly measuresForce: boolean;
  /** Whether it also measures the moments about the two other axes, and so the centre of pressure. */
  readonly measuresPressure: boolean;
}

/** One foot of a robot. */
export interface Foot {
  /** The site of its sensor, or its link. */
  readonly name: string;
  /** The link that has the sole: its index and its name. */
  readonly link: number;
  readonly linkName: string;
  readonly sole: SolePlane;
  readonly sensor: FootSensor | null;
}

/** What is known about a robot before it moves: its masses and its feet. */
export interface Standing {
  /** Empty if `massGap` gives a reason. */
  readonly masses: readonly MassPoint[];
  readonly massGap: BalanceGap | null;
  /** Empty if `footGap` gives a reason. */
  readonly feet: readonly Foot[];
  readonly footGap: BalanceGap | null;
  readonly ground: Ground | null;
  /** The parts of the model or profile that could not be read, one line each. */
  readonly problems: readonly string[];
}
