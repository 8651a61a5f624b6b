import type { Vec3 } from '../../twin/rotation.ts';
import type { Joint } from '../kinematics.ts';

/** Mass of one link. */
export interface BalanceMass {
  /** Index of the link. */
  readonly link: number;
  readonly mass_kg: number;
  /** Centre of mass in the link's frame, metres. */
  readonly xyz: Vec3;
}

/** What a link stands on. */
export interface Sole {
  /** Index of the link. */
  readonly link: number;
  /** A convex polygon in one plane, in the link's frame (metres), counter-clockwise seen from above. */
  readonly points: readonly Vec3[];
}

/** What the arithmetic of balance needs of a model's manifest (docs/MODEL.md). */
export interface BalanceModel {
  /** Root first. */
  readonly links: readonly string[];
  readonly joints: readonly Joint[];
  /** []: no masses, or masses that can't be. null: the bundle's builder did not know of them. */
  readonly inertials: readonly BalanceMass[] | null;
  /** null: the bundle's builder did not know of them. */
  readonly soles: readonly Sole[] | null;
  readonly findings: readonly { readonly code: string }[];
}
