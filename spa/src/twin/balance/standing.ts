import type { Ground } from '@posecast/wire';
import type { Vec3 } from '../rotation.ts';
import type { BalanceGap } from './balance.ts';

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
