import type { JointType, Triple as Vector } from '../model/kinematics.ts';
import type { Finding } from './finding.ts';

/** The parsed contents of a URDF: metres, radians, rpy about fixed axes. */

export type { JointType, Triple as Vector } from '../model/kinematics.ts';

export interface Shape {
  readonly kind: 'mesh' | 'box' | 'cylinder' | 'sphere' | 'capsule';
  readonly uri: string;
  readonly scale: Vector;
  readonly dims: readonly number[];
  readonly line: number | null;
}

export interface Visual {
  readonly xyz: Vector;
  readonly rpy: Vector;
  readonly shape: Shape | null;
  readonly material: Material | null;
  readonly line: number | null;
}

export interface Material {
  readonly name: string;
  readonly rgba: readonly number[] | null;
  readonly texture: string | null;
  readonly line: number | null;
}

export interface Inertial {
  readonly mass: number;
  /** ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, in the axes of `rpy`; kg·m². */
  readonly moments: readonly number[];
  /** link_from_centre. */
  readonly xyz: Vector;
  readonly rpy: Vector;
  readonly line: number | null;
}

export interface Link {
  readonly name: string;
  /** Its visuals, or its collision shapes if no link of the robot has a visual. */
  readonly visuals: readonly Visual[];
  readonly inertial: Inertial | null;
  readonly line: number | null;
}

/** A joint's limits; null means not given. */
export interface Limit {
  readonly lower: number | null;
  readonly upper: number | null;
  readonly velocity: number | null;
  readonly effort: number | null;
  readonly line: number | null;
}

export interface Mimic {
  readonly joint: string;
  readonly multiplier: number;
  /** rad or m. */
  readonly offset: number;
  readonly line: number | null;
}

export interface Joint {
  readonly name: string;
  readonly type: JointType;
  readonly parent: string;
  readonly child: string;
  readonly xyz: Vector;
  readonly rpy: Vector;
  /** As written; null if absent. */
  readonly axis: Vector | null;
  readonly limit: Limit | null;
  readonly mimic: Mimic | null;
  readonly line: number | null;
}

export interface Urdf {
  readonly name: string;
  /** In file order, including duplicates. */
  readonly links: readonly Link[];
  readonly joints: readonly Joint[];
  readonly materials: ReadonlyMap<string, Material>;
  readonly sensors: readonly { readonly name: string; readonly link: string; readonly line: number | null }[];
  /** References to joints or links outside the tree. */
  readonly references: readonly {
    readonly what: string;
    readonly name: string;
    readonly by: string;
    readonly line: number | null;
  }[];
  readonly findings: readonly Finding[];
}

/** A limit this large (rad or m) counts as none. */
export const UNBOUNDED = 1e4;

export const SCALAR_TYPES: ReadonlySet<string> = new Set(['revolute', 'continuous', 'prismatic']);

/** A visual's material: the robot's material with that name, else its own. */
export function materialOf({ material }: Visual, { materials }: Urdf): Material | null {
  return material === null ? null : (materials.get(material.name) ?? material);
}
