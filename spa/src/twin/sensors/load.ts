import { JOINT, type Level, type Schema, type Threshold } from '@posecast/wire';
import { type LimitedName, numberOf } from '../joints.ts';
import { LevelLatch, type ValueLimits, worseOf } from '../limits.ts';
import { valueAt } from '../values.ts';

export type LoadField = LimitedName;

/** How loaded one joint is. */
export interface Load {
  /** 0 at rest … 1 at or beyond its limit; null: no reading. */
  part: number | null;
  level: Level;
}

/** The meaning of the load colours. */
export interface LoadScale {
  readonly field: LoadField;
  readonly unit: string;
  readonly rest: number;
  /** The value at the end of the scale; null if joints have different limits, so that the scale is relative to each limit. */
  readonly full: number | null;
  /** Whether `full` is a limit, or only the largest value seen so far. */
  readonly limited: boolean;
  /** The fraction (0…1) at which caution starts; null if joints differ or have no limits. */
  readonly cautionPart: number | null;
}

/** Current or temperature of each URDF joint relative to its limit, for colours on the body. */
export class LoadTable {
  readonly #schema: Schema;
  readonly #field: LoadField;
  /** The start of the colour scale. */
  readonly #rest: number;
  readonly #loads = new Map<string, Load>();
  readonly #latches: readonly LevelLatch[];
  readonly #jointsOf: ReadonlyMap<string, readonly string[]>;
  #largest = 0;

  constructor(schema: Schema, field: LoadField) {
    this.#schema = schema;
    this.#field = field;
    this.#rest = numberOf(field)?.rest ?? 0;
    const of = schema.field(field);
    this.#latches = (of?.labels ?? []).map(() => new LevelLatch());
    const jointsOf = new Map<string, string[]>();
    for (const label of of?.labels ?? []) if (!schema.mapping.joints.has(label)) jointsOf.set(label, [label]);
    for (const [joint, { terms }] of schema.mapping.joints) {
      for (const [channel] of terms) jointsOf.set(channel, [...(jointsOf.get(channel) ?? []), joint]);
    }
    this.#jointsOf = jointsOf;
  }

  /** Whether the robot reports this field for its joints. */
  static has(schema: Schema, field: LoadField): boolean {
    return schema.field(field)?.labelSet === JOINT;
  }

  /** URDF joint → load, the highest of the channels that move it. Always the same map. */
  read(codes: Int32Array, limits: ValueLimits): ReadonlyMap<string, Load> {
    const field = this.#schema.field(this.#field);
    this.#loads.clear();
    for (let index = 0; index < (field?.size ?? 0); index += 1) {
      const value = valueAt(codes, field, index);
      if (value !== null) this.#largest = Math.max(this.#largest, this.#away(value));
    }
    field?.labels.forEach((label, index) => {
      const value = valueAt(codes, field, index);
      const threshold = limits.threshold(this.#field, label);
      const level = this.#latches[index]!.next(threshold, value);
      const part = value === null ? null : this.#part(value, threshold);
      for (const joint of this.#jointsOf.get(label) ?? []) {
        const known = this.#loads.get(joint);
        if (known === undefined) this.#loads.set(joint, { part, level });
        else {
          known.part = part === null ? known.part : Math.max(part, known.part ?? 0);
          known.level = worseOf(known.level, level);
        }
      }
    });
    return this.#loads;
  }

  scale(limits: ValueLimits): LoadScale {
    const field = this.#schema.field(this.#field);
    const rest = this.#rest;
    const base = { field: this.#field, unit: field?.unit ?? '', rest };
    const all = (field?.labels ?? []).map((label) => limits.threshold(this.#field, label));
    const found = all.filter((threshold) => threshold !== null);
    if (found.length === 0) {
      return { ...base, full: rest + this.#largest, limited: false, cautionPart: null };
    }
    const [first] = found;
    const alike = found.every((t) => fullOf(t!) === fullOf(first!) && t!.caution === first!.caution);
    if (!alike) return { ...base, full: null, limited: true, cautionPart: null };
    const full = fullOf(first!);
    return { ...base, full, limited: true, cautionPart: (full * first!.caution - rest) / (full - rest) };
  }

  #away(value: number): number {
    return Math.abs(value - this.#rest);
  }

  /** The position of a value between rest and its limit on that side (0…1); without limits, relative to the largest value
   *  seen.
   */
  #part(value: number, threshold: Threshold | null): number {
    const rest = this.#rest;
    const limit = value < rest ? threshold?.low : threshold?.high;
    if (limit == null) return threshold === null && this.#largest > 0 ? this.#away(value) / this.#largest : 0;
    const whole = limit - rest;
    if (whole * (value - rest) <= 0) return value === rest ? 0 : 1; // a limit on this side of rest: exceeded
    return Math.min(1, (value - rest) / whole);
  }
}

function fullOf({ low, high }: Threshold): number {
  return high ?? Math.abs(low ?? 0);
}
