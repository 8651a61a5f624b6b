import { JOINT, type Level, type Schema, type Threshold } from '@posecast/wire';
import type { LinkTint, PosedBody } from '../../model/posed_body.ts';
import { jointOfLinks } from '../../model/posed_body.ts';
import { type LimitedName, numberOf } from '../../twin/joints.ts';
import { LevelLatch, type ValueLimits, worseOf } from '../../twin/limits.ts';
import { valueAt } from '../../twin/values.ts';
import { levelPaint, type Sign, type SignFrame, type SignPicture, type SignSettings } from './sign.ts';

export type LoadField = LimitedName;

/** How loaded one joint is. */
export interface JointLoad {
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
  readonly #loads = new Map<string, JointLoad>();
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
  read(codes: Int32Array, limits: ValueLimits): ReadonlyMap<string, JointLoad> {
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

/** Paints each link by the load of the joint that moves it; links fixed to it get the same colour. */
export class Load implements Sign {
  static readonly key = 'loads';
  readonly #schema: Schema;
  #table: LoadTable | null = null;
  #field: SignSettings['load'] = 'off';
  #limits: ValueLimits | null = null;
  #loads: ReadonlyMap<string, JointLoad> | null = null;
  #body: PosedBody | null = null;
  /** Link → the joint that moves it, or null. */
  #jointOf: ReadonlyMap<string, string | null> = new Map();
  readonly #colors = new Map<string, number>();

  constructor(schema: Schema) {
    this.#schema = schema;
  }

  /** The fields that can colour a robot's body. */
  static fieldsOf(schema: Schema): readonly LoadField[] {
    return (['cur', 'temp'] as const).filter((field) => LoadTable.has(schema, field));
  }

  static can(schema: Schema): boolean {
    return Load.fieldsOf(schema).length > 0;
  }

  static shown({ load }: SignSettings): boolean {
    return load !== 'off';
  }

  /** Link → #rrggbb. */
  get drawn(): Readonly<Record<string, string>> {
    const css = (color: number) => `#${color.toString(16).padStart(6, '0')}`;
    return Object.fromEntries([...this.#colors].map(([link, color]) => [link, css(color)]));
  }

  /** The meaning of the colours; null for a robot without this reading. */
  get scale(): LoadScale | null {
    return this.#limits === null ? null : (this.#table?.scale(this.#limits) ?? null);
  }

  read({ codes, limits, settings: { load } }: SignFrame): void {
    if (load !== this.#field) {
      this.#field = load;
      const has = load !== 'off' && LoadTable.has(this.#schema, load);
      this.#table = has ? new LoadTable(this.#schema, load) : null;
    }
    this.#limits = limits;
    this.#loads = this.#table?.read(codes, limits) ?? null;
  }

  draw(picture: SignPicture): void {
    const { body, tints } = picture;
    if (body !== this.#body) {
      this.#body = body;
      this.#jointOf = jointOfLinks(body);
    }
    this.#colors.clear();
    if (this.#loads === null) return;
    const fault = levelPaint(picture, 'fault').color;
    for (const [link, joint] of this.#jointOf) {
      const tint = tintOf(joint === null ? undefined : this.#loads.get(joint), fault);
      this.#colors.set(link, tint.color);
      tints.set(link, tint);
    }
  }
}

/** `fault`: the colour (sRGB) of a joint past its limit, which is also hatched. */
function tintOf(load: JointLoad | undefined, fault: number): LinkTint {
  if (load === undefined || load.part === null) return { color: NO_LOAD, hatched: load?.level === 'fault' };
  const hatched = load.level === 'fault';
  return { color: hatched ? fault : loadColor(load.part), hatched };
}

/** Load colours from rest to limit, sRGB, also ordered from bright to dark, so that colour-blind people see the order. */
const RAMP = [0xcfd8e6, 0xd9cfa8, 0xe8bf57, 0xdd8b26, 0xb4531a] as const;
/** Colour of a link without a load reading. */
export const NO_LOAD = 0x7f8894;

/** The colour (sRGB 0xrrggbb) of a load: 0 at rest … 1 at the limit. */
export function loadColor(part: number): number {
  const at = Math.min(1, Math.max(0, part)) * (RAMP.length - 1);
  const low = Math.min(RAMP.length - 2, Math.floor(at));
  const mix = (shift: number) => {
    const [a, b] = [(RAMP[low]! >> shift) & 255, (RAMP[low + 1]! >> shift) & 255];
    return Math.round(a + (b - a) * (at - low)) << shift;
  };
  return mix(16) | mix(8) | mix(0);
}
