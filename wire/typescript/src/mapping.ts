/** What channels mean for the model: joints, mounts, names, limits. The schema's `mapping` member. */

import { entries, fail, items, member, number, table, text } from './checked.ts';
import { MISSING, type Schema } from './schema.ts';

const ANY = '*';
/** The label set whose channels move the body. */
export const JOINT = 'joint';

const SENSOR_KINDS = ['wrench', 'imu', 'power'] as const;
const SEVERITIES = ['fault', 'caution', 'state'] as const;

export type SensorKind = (typeof SENSOR_KINDS)[number];
export type Severity = (typeof SEVERITIES)[number];
export type Level = 'ok' | 'caution' | 'fault';
export type Xyz = readonly [number, number, number];

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
    private readonly sentences: ReadonlyMap<string, ReadonlyMap<string, ReadonlyMap<string, Sentence>>>,
  ) {}

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

/** The `mapping` member of a schema, parsed from JSON. SchemaError names what and where. */
export function parseMapping(value: unknown): Mapping {
  const doc = table(value, 'mapping');
  const part = <T>(name: string, read: (v: unknown, at: string, key: string) => T): Map<string, T> =>
    entries(doc.get(name), `mapping.${name}`, read);
  return new Mapping(
    part('joints', joint),
    part('sensors', sensor),
    part('names', text),
    part('thresholds', (v, at) => entries(v, at, threshold)),
    part('tolerance', atLeastZero),
    part('severity', (v, at) => entries(v, at, severity)),
    part('units', (v, at) => entries(v, at, text)),
    part('explain', (v, at) => entries(v, at, (bit, of) => entries(bit, of, sentence))),
  );
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

function joint(value: unknown, where: string): JointMap {
  const doc = table(value, where);
  const terms = items(doc.get('terms'), `${where}.terms`).map((item, i): readonly [string, number] => {
    const at = `${where}.terms[${i}]`;
    const pair = items(item, at);
    if (pair.length !== 2) fail(at, 'must be [channel, gain]');
    return [text(pair[0], `${at}[0]`), number(pair[1], `${at}[1]`)];
  });
  return { terms, offset: number(member(doc, 'offset', 0), `${where}.offset`) };
}

function sensor(value: unknown, where: string, site: string): SensorMount {
  const doc = table(value, where);
  const kind = text(doc.get('kind'), `${where}.kind`);
  const known = SENSOR_KINDS.find((k) => k === kind);
  if (!known) fail(`${where}.kind`, `'${kind}' is none of ${SENSOR_KINDS.join(', ')}`);
  const link = doc.get('link') ?? null;
  return {
    kind: known,
    name: text(member(doc, 'name', site), `${where}.name`),
    link: link === null ? null : text(link, `${where}.link`),
    xyz: xyz(member(doc, 'xyz', [0, 0, 0]), `${where}.xyz`),
    rpy: xyz(member(doc, 'rpy', [0, 0, 0]), `${where}.rpy`),
  };
}

function xyz(value: unknown, where: string): Xyz {
  const found = items(value, where);
  if (found.length !== 3) fail(where, 'must be three numbers');
  const [x, y, z] = found.map((v, i) => number(v, `${where}[${i}]`));
  return [x!, y!, z!];
}

function threshold(value: unknown, where: string): Threshold {
  const doc = table(value, where);
  const limit = (name: string): number | null => {
    const found = doc.get(name) ?? null;
    return found === null ? null : number(found, `${where}.${name}`);
  };
  const [low, high] = [limit('low'), limit('high')];
  const caution = number(member(doc, 'caution', 1), `${where}.caution`);
  if (!(caution > 0 && caution <= 1)) fail(`${where}.caution`, 'must lie above 0 and not above 1');
  if (low !== null && high !== null && low >= high) fail(where, 'low must lie below high');
  return { low, high, caution };
}

function atLeastZero(value: unknown, where: string): number {
  const found = number(value, where);
  if (found < 0) fail(where, 'must not be negative');
  return found;
}

function sentence(value: unknown, where: string): Sentence {
  const doc = table(value, where);
  const why = doc.get('why') ?? null;
  return { say: text(doc.get('say'), `${where}.say`), why: why === null ? null : text(why, `${where}.why`) };
}

function severity(value: unknown, where: string): Severity {
  const known = SEVERITIES.find((s) => s === value);
  if (!known) fail(where, `must be one of ${SEVERITIES.join(', ')}`);
  return known;
}
