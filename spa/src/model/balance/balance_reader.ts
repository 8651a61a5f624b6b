import type { Schema } from '@posecast/wire';
import type { Balance } from '../../twin/balance/balance.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import type { PosedBody } from '../posed_body.ts';
import type { BalanceModel } from './balance_model.ts';

/** The profile's `[balance]` (SPEC §2, `mapping.balance`). */
export interface BalanceProfile {
  /** Sites of wrench sensors, or links; []: none named. */
  readonly feet: readonly string[];
  readonly ground: 'measured' | 'lowest' | null;
  /** Foot → its sole in the foot's link, metres. */
  readonly soles: ReadonlyMap<string, readonly Vec3[]>;
}

/** A wrench as far as balance needs it; one of `WrenchTable` fits. */
export interface FootWrench {
  readonly site: string;
  /** N and N·m in the sensor's axes; null without a reading. `axes`: those that are measured (0 x, 1 y, 2 z). */
  readonly force: { readonly vector: Vec3 | null; readonly axes: readonly number[] };
  readonly moment: { readonly vector: Vec3 | null; readonly axes: readonly number[] };
}

/**
 * Reads a robot's balance pose by pose, from frames' codes or from a body that is shown. One reader serves one course of
 * poses in the order of time: it keeps which feet bear, and the velocity. A new schema or model needs a new reader.
 */
export class BalanceReader {
  constructor(
    readonly model: BalanceModel,
    readonly schema: Schema,
  ) {}

  /** Whether the page shows balance unless told otherwise: two feet with wrenches, and masses. */
  get onByItself(): boolean {
    throw new Error('to come');
  }

  /** The wrenches of a frame's codes, rewritten in place. */
  wrenches(_codes: Int32Array): readonly FootWrench[] {
    throw new Error('to come');
  }

  /** The balance of a frame (for words, limits and plots). `tS` is the robot's time, seconds. The result is rewritten by
   *  the next call. */
  ofFrame(_codes: Int32Array, _tS: number): Balance {
    throw new Error('to come');
  }

  /** The balance of a body as it is shown (for signs), with the wrenches of the same moment. `tS` is the time of the pose
   *  that is shown, seconds. The result is rewritten by the next call. */
  ofBody(_body: Pick<PosedBody, 'linkMatrix'>, _wrenches: readonly FootWrench[], _tS: number): Balance {
    throw new Error('to come');
  }
}
