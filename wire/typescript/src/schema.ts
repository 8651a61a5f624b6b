/** The schema of a stream: its channels, their order, the unit and scale of their codes, and what they mean for the model. */

/** The code of "no reading". */
export const MISSING = -(2 ** 28);
/** Readings lie in -CODE_MAX … CODE_MAX. */
export const CODE_MAX = 2 ** 28 - 1;

const ANY = '*';
/** The label set whose channels move the body. */
export const JOINT = 'joint';

export const SENSOR_KINDS = ['wrench', 'imu', 'power'] as const;
export const SEVERITIES = ['fault', 'caution', 'state'] as const;

export type SensorKind = (typeof SENSOR_KINDS)[number];
export type Severity = (typeof SEVERITIES)[number];
export type Level = 'ok' | 'caution' | 'fault';
export type Xyz = readonly [number, number, number];

/** Channels `start` … `start + size - 1` of the code vector; value = code × scale, in `unit`. */
export class Field {
  readonly size: number;

  constructor(
    readonly name: string,
    readonly labels: readonly string[],
    readonly labelSet: string,
    readonly unit: string,
    readonly scale: number,
    /** The earlier field whose movement this one shares. */
    readonly rel: string | null,
    /** Names, lowest bit first; empty for a number. */
    readonly bits: readonly string[],
    readonly slow: boolean,
    readonly start: number,
  ) {
    this.size = labels.length;
  }

  /** The value of one code, null where there is no reading. */
  value(code: number): number | null {
    return code === MISSING ? null : code * this.scale;
  }

  /** Names of the bits set in one code of a `bits` field; a bit without a name reads `bit N`. */
  bitsSet(code: number): string[] {
    const set: string[] = [];
    if (code !== MISSING)
      for (let i = 0; code >> i; i++) if ((code >> i) & 1) set.push(this.bits[i] ?? `bit ${i}`);
    return set;
  }
}

/** URDF joint = Σ gain × channel + offset, for pos and ref alike (rad, or m for a sliding joint). */
export interface JointMap {
  readonly terms: readonly (readonly [channel: string, gain: number])[];
  readonly offset: number;
}

/** Where a sensor sits. `xyz` m, `rpy` rad (fixed axes X, Y, Z as in URDF), from its link. */
export interface SensorMount {
  readonly kind: SensorKind;
  readonly name: string;
  readonly link: string | null;
  readonly xyz: Xyz;
  readonly rpy: Xyz;
}

/** Limits in the field's unit; `caution` in (0, 1]: how near to a limit yellow starts. */
export interface Threshold {
  readonly low: number | null;
  readonly high: number | null;
  readonly caution: number;
}

/** What a bit means, in one language: `say` with places for names and values (SPEC §2), and `why`, one more sentence. */
export interface Sentence {
  readonly say: string;
  readonly why: string | null;
}

/** `fault` past a limit, `caution` past the fraction of it that points to rest, else `ok`. */
export function level(threshold: Threshold, value: number | null): Level {
  if (value === null || Number.isNaN(value)) return 'ok';
  const { low, high, caution } = threshold;
  if ((high !== null && value > high) || (low !== null && value < low)) return 'fault';
  if (high !== null && value > (high >= 0 ? high * caution : high / caution)) return 'caution';
  if (low !== null && value < (low <= 0 ? low * caution : low / caution)) return 'caution';
  return 'ok';
}

/** All parts are optional; keys are channels, sites, fields and bits by name. */
export class Mapping {
  constructor(
    readonly joints: ReadonlyMap<string, JointMap>,
    readonly sensors: ReadonlyMap<string, SensorMount>,
    readonly names: ReadonlyMap<string, string>,
    private readonly thresholds: ReadonlyMap<string, ReadonlyMap<string, Threshold>>,
    private readonly tolerances: ReadonlyMap<string, number>,
    private readonly severities: ReadonlyMap<string, ReadonlyMap<string, Severity>>,
    private readonly units: ReadonlyMap<string, ReadonlyMap<string, string>>,
    private readonly translatedNames: ReadonlyMap<string, ReadonlyMap<string, string>>,
    private readonly sentences: ReadonlyMap<string, ReadonlyMap<string, ReadonlyMap<string, Sentence>>>,
  ) {}

  /** What people who read `language` ("ko") call a channel or site; null where nobody says. */
  name(label: string, language: string): string | null {
    const names = this.translatedNames.get(language);
    return names?.get(label) ?? this.names.get(label) ?? this.translatedNames.get('en')?.get(label) ?? null;
  }

  /** What a bit means, by language ("en"); null where nobody says. */
  sentence(field: string, bit: string): ReadonlyMap<string, Sentence> | null {
    return this.sentences.get(field)?.get(bit) ?? null;
  }

  /** The unit of one channel where it is not its field's, else null. */
  unit(field: string, label: string): string | null {
    return this.units.get(field)?.get(label) ?? null;
  }

  /** The limits of one channel, else those of `*` in its field, else null. */
  threshold(field: string, label: string): Threshold | null {
    const ofField = this.thresholds.get(field);
    return ofField?.get(label) ?? ofField?.get(ANY) ?? null;
  }

  /** How far ref and pos may part before it shows (rad or m). */
  tolerance(channel: string): number | null {
    return this.tolerances.get(channel) ?? this.tolerances.get(ANY) ?? null;
  }

  /** A bit nobody classified counts as a fault: better a false alarm than a hidden one. */
  severity(field: string, bit: string): Severity {
    return this.severities.get(field)?.get(bit) ?? 'fault';
  }
}

/** A schema as `parseSchema` reads it. `text` is the exact text received; `id` its FNV-1a-32, which KEY frames name. */
export class Schema {
  private readonly byName: ReadonlyMap<string, Field>;

  constructor(
    readonly text: string,
    readonly id: number,
    readonly robot: string,
    readonly fields: readonly Field[],
    readonly size: number,
    readonly mapping: Mapping,
  ) {
    this.byName = new Map(fields.map((f) => [f.name, f]));
  }

  /** No KEY of this schema is longer (SPEC §4): a code takes 63 bits at most, its order 4. */
  get keyBytesMax(): number {
    return 17 + Math.ceil((4 * this.fields.length + 67 * this.size) / 8);
  }

  /** No other frame of this schema is longer. */
  get frameBytesMax(): number {
    return 9 + Math.ceil((4 * this.fields.length + 63 * this.size) / 8);
  }

  field(name: string): Field | null {
    return this.byName.get(name) ?? null;
  }
}

/**
 * One field of a schema as joint positions of the model: the mapping compiled into flat arrays.
 * `evaluate` allocates nothing and returns the same array each time.
 */
export class JointMapping {
  /** URDF joints, in the order of the values. */
  readonly joints: readonly string[];
  /** rad or m; NaN where a term has no reading or its channel is not in the field. */
  readonly values: Float64Array;
  private readonly offsets: Float64Array;
  private readonly termStarts: Int32Array; // joint i owns terms termStarts[i] … termStarts[i+1] - 1
  private readonly channels: Int32Array; // index into the code vector; -1 = not in the field
  private readonly gains: Float64Array;
  private readonly scale: number;

  /** No joints when the schema lacks the field. */
  constructor(schema: Schema, fieldName: string) {
    const field = schema.field(fieldName);
    const joints = new Map<string, JointMap>();
    const channelOf = new Map(field?.labels.map((label, i) => [label, field.start + i]));
    if (field?.labelSet === JOINT)
      for (const label of field.labels) joints.set(label, { terms: [[label, 1]], offset: 0 });
    if (field) for (const [name, how] of schema.mapping.joints) joints.set(name, how);
    const all = [...joints.values()];
    const terms = all.flatMap((how) => how.terms);
    let next = 0;
    this.joints = [...joints.keys()];
    this.values = new Float64Array(all.length).fill(Number.NaN);
    this.offsets = Float64Array.from(all, (how) => how.offset);
    this.termStarts = Int32Array.from([0, ...all.map((how) => (next += how.terms.length))]);
    this.channels = Int32Array.from(terms, ([channel]) => channelOf.get(channel) ?? -1);
    this.gains = Float64Array.from(terms, ([, gain]) => gain);
    this.scale = field?.scale ?? 1;
  }

  evaluate(codes: Int32Array): Float64Array {
    const { values, offsets, termStarts, channels, gains, scale } = this;
    for (let j = 0; j < values.length; j++) {
      let total = offsets[j]!;
      for (let i = termStarts[j]!; i < termStarts[j + 1]!; i++) {
        const code = channels[i]! < 0 ? MISSING : codes[channels[i]!]!;
        total += code === MISSING ? Number.NaN : gains[i]! * (code * scale);
      }
      values[j] = total;
    }
    return values;
  }
}

/** A schema that has come through `postMessage`, which takes the classes off: gives them back, in place. */
export function revived(schema: Schema): Schema {
  for (const field of schema.fields) Object.setPrototypeOf(field, Field.prototype);
  Object.setPrototypeOf(schema.mapping, Mapping.prototype);
  return Object.setPrototypeOf(schema, Schema.prototype) as Schema;
}
