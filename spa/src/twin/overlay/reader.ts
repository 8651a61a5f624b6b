import type { Schema } from '@posecast/wire';
import { JointChannels } from '../joint_channels.ts';
import type { Threshold, ValueLimits } from '../limits/limits.ts';
import type { LeadState } from '../robot.ts';
import { type Imu, ImuTable } from '../sensors/imus.ts';
import { type Load, type LoadField, type LoadScale, LoadTable } from '../sensors/load.ts';
import { type Wrench, WrenchTable } from '../sensors/wrenches.ts';
import { type Deviation, type DeviationGhost, DeviationTable } from './deviations.ts';

/** The overlay signs that a viewer has switched on. */
export interface OverlayChoice {
  readonly shown: 'pos' | 'ref' | 'both';
  readonly lens: boolean;
  readonly forces: boolean;
  readonly level: boolean;
  readonly load: 'off' | LoadField;
  /** `auto`: on for robots with two feet that measure forces, and with masses. */
  readonly balance?: 'auto' | 'on' | 'off';
  /** The channel whose joints' limits are drawn with the balance; null for none. */
  readonly joint?: string | null;
  readonly headingLocked?: boolean;
}

/** What the balance signs need in addition to the displayed pose. */
export interface BalanceReadings {
  readonly schema: Schema;
  readonly choice: 'auto' | 'on';
  /** Limits of the margin, mm; null for none. */
  readonly limits: Threshold | null;
  /** URDF joints whose limits are drawn. */
  readonly joints: readonly string[];
  /** Whether the robot reports its position in the world, and is shown there. */
  readonly anchored: boolean;
  /** At rest in the past: the states that led up to the displayed one, at `tS`; otherwise null or omitted. */
  readonly lead?: { readonly states: readonly Pick<LeadState, 'tS' | 'codes'>[]; readonly tS: number } | null;
}

/** The overlay's readings of the newest frame. Signs that are off, or that the robot does not have, are empty. */
export interface OverlayReadings {
  readonly wrenches: readonly Wrench[];
  readonly deviations: readonly Deviation[];
  readonly imus: readonly Imu[];
  /** The one of `imus` that measures the body's lean. */
  readonly body: Imu | null;
  /** Whether the robot reports its base's orientation (and the level sign is on). */
  readonly based: boolean;
  /** Load by URDF joint; null while links keep their own colours. */
  readonly loads: ReadonlyMap<string, Load> | null;
  /** null: no balance signs. */
  readonly balance: BalanceReadings | null;
}

/** Reads, frame by frame, everything drawn about one robot's body. A new schema needs a new reader. */
export class OverlayReader {
  readonly schema: Schema;
  readonly #wrenches: WrenchTable;
  readonly #deviations: DeviationTable;
  readonly #imus: ImuTable;
  #channels: JointChannels | null = null;
  #load: LoadTable | null = null;
  #loadField: OverlayChoice['load'] = 'off';

  constructor(schema: Schema) {
    this.schema = schema;
    this.#wrenches = new WrenchTable(schema);
    this.#deviations = new DeviationTable(schema);
    this.#imus = new ImuTable(schema);
  }

  /** What this robot can show at all. */
  get can(): { forces: boolean; level: boolean; lens: boolean; loads: LoadField[] } {
    const { schema } = this;
    return {
      forces: this.#wrenches.wrenches.length > 0,
      level: this.#imus.imus.length > 0 || schema.field('baseq') !== null,
      lens: schema.field('ref') !== null && schema.field('pos') !== null,
      loads: (['cur', 'temp'] as const).filter((field) => LoadTable.has(schema, field)),
    };
  }

  read(codes: Int32Array, limits: ValueLimits, choice: OverlayChoice): OverlayReadings {
    const { forces, level, lens, shown } = choice;
    return {
      wrenches: forces ? this.#wrenches.read(codes, limits) : [],
      deviations: lens || shown === 'both' ? this.#deviations.read(codes) : [],
      imus: level ? this.#imus.read(codes) : [],
      body: level ? this.#imus.body : null,
      based: level && this.schema.field('baseq') !== null,
      loads: this.#loads(choice.load)?.read(codes, limits) ?? null,
      balance: this.#balance(limits, choice),
    };
  }

  /**
   * The ghost for the deviations; null for none, and if the whole ghost is shown anyway.
   */
  ghost({ deviations }: OverlayReadings, { shown, lens }: OverlayChoice): DeviationGhost | null {
    return !lens || shown === 'both' ? null : this.#deviations.ghost(deviations, shown);
  }

  /** The scale of the load colours; null while they are off. */
  loadScale(limits: ValueLimits, field: OverlayChoice['load']): LoadScale | null {
    return this.#loads(field)?.scale(limits) ?? null;
  }

  #balance(
    limits: ValueLimits,
    { balance = 'off', joint = null, headingLocked = false }: OverlayChoice,
  ): BalanceReadings | null {
    const { schema } = this;
    if (balance === 'off' || (balance === 'auto' && this.#wrenches.wrenches.length < 2)) return null;
    if (joint !== null) this.#channels ??= new JointChannels(schema);
    return {
      schema,
      choice: balance,
      limits: limits.threshold('balance', 'margin'),
      joints: joint === null ? [] : this.#channels!.jointsOf(joint),
      anchored: !headingLocked && schema.field('base') !== null && schema.field('baseq') !== null,
    };
  }

  #loads(field: OverlayChoice['load']): LoadTable | null {
    if (field !== this.#loadField) {
      this.#loadField = field;
      const has = field !== 'off' && LoadTable.has(this.schema, field);
      this.#load = has ? new LoadTable(this.schema, field) : null;
    }
    return this.#load;
  }
}
