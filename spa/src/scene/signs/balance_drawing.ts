import type { Ground, Level } from '@posecast/wire';
import type { PosedBody } from '../../model/posed_body.ts';
import type { Vec2 } from '../../twin/balance/balance.ts';

import type { AngleUnit } from '../../twin/format.ts';
import type { BalanceReadings } from '../../twin/overlay/reader.ts';
import type { Pose } from '../../twin/playback/pose.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import type { OverlayColors, PaletteName } from './colors.ts';
import type { FacetNumbers } from './facet_numbers.ts';
import type { OverlayLabel } from './labels.ts';

/** A joint whose limits are drawn. */
export interface ShownJoint {
  readonly joint: string;
  /** Distance to the nearer limit, rad or m; negative beyond it. */
  readonly left: number;
  readonly slides: boolean;
}

/** The balance signs shown now, for tests and the debug interface. Lengths are metres in the world. */
export interface ShownBalance {
  readonly centreOfMass: Vec3 | null;
  readonly capturePoint: Vec3 | null;
  readonly floorM: number | null;
  readonly ground: Ground | null;
  readonly polygon: readonly Vec2[];
  readonly nearestEdge: number | null;
  readonly marginM: number | null;
  /** The drawn level of the margin. */
  readonly level: Level;
  readonly pressure: Vec3 | null;
  readonly feet: readonly {
    readonly name: string;
    readonly bears: boolean | null;
    readonly pressure: Vec3 | null;
    readonly atEdge: boolean;
  }[];
  /** The number of footprints, and of trace points. */
  readonly footprints: number;
  readonly trace: number;
  readonly joints: readonly ShownJoint[];
}

/** Style of the balance signs. */
export interface BalanceStyle {
  /** The robot's radius, m. */
  readonly reach: number;
  readonly tones: OverlayColors;
  readonly palette: PaletteName;
  readonly angle: AngleUnit;
  /** false: the pose is out of date, and everything is grey. */
  readonly live: boolean;
}

/** Draws the balance of one robot. */
export interface BalanceDrawing {
  /** null while there is nothing to show. */
  readonly shown: ShownBalance | null;
  /** Adds its facets for a body in the displayed pose. */
  draw(body: PosedBody | null, pose: Pose | null, readings: BalanceReadings, style: BalanceStyle): void;
  /** The labels for the newest `draw`. */
  labels(): OverlayLabel[];
}

/** The balance of all robots in one picture. */
export interface BalancePicture {
  readonly facets: FacetNumbers;
  /** Starts a new picture. */
  begin(): void;
  /** Completes the picture. False if it equals the previous one. */
  end(): boolean;
  /** Creates the object that draws the balance of one robot. */
  addRobot(): BalanceDrawing;
}

/** The code that draws balance is loaded on demand and passed to the overlay. */
export type MakeBalance = () => BalancePicture;
