import { type Field, type Level, MISSING, type Schema, type Severity } from '@posecast/wire';
import { flagWords } from './format.ts';
import { LevelLatch, type Threshold, ValueLimits } from './limits.ts';
import { valueAt } from './values.ts';

export interface Flag {
  /** The bit's name, as the robot reports it. */
  name: string;
  /** The name in words for people, see `flagWords`. */
  words: string;
  severity: Severity;
}

/** One row of the joint table, without its numbers (see `JointTable.numbers`). */
export interface JointRow {
  readonly label: string;
  homed: boolean | null;
  enabled: boolean | null;
  /** The flags that are set, without homed and enabled: faults first, then cautions, then states. */
  flags: readonly Flag[];
  /** The worst of flags, limits and `apart`. */
  level: Level;
  curLevel: Level;
  tempLevel: Level;
  /** The joint is compliant on purpose, so a deviation from its command is no fault. */
  compliant: boolean;
  /** It deviates from its command by more than the profile's tolerance, and is not compliant. */
  apart: boolean;
}

/** The table's columns of numbers. All but `error` (ref − pos) come straight from a field of the schema. */
export const NUMBERS = ['ref', 'pos', 'error', 'vel', 'effort', 'cur', 'temp'] as const;
export type NumberName = (typeof NUMBERS)[number];
type Columns = Readonly<Record<NumberName | 'flags', Field | null>>;

const RANK: Readonly<Record<Severity, number>> = { fault: 0, caution: 1, state: 2 };
/** Hysteresis: a deviation ends when |ref − pos| falls below this part of the tolerance. */
export const CLOSE_AGAIN = 0.8;
const SHOWN_AS_COLUMNS = new Set(['homed', 'enabled']);
const NO_FLAGS: readonly Flag[] = [];

/** The joint table of one schema. `read` updates its rows and numbers in place, so that it creates no garbage at frame rate. */
export class JointTable {
  readonly rows: readonly JointRow[];
  /** For each column, an array with one number per row, in the schema's unit; NaN is no reading. */
  readonly numbers: Readonly<Record<NumberName, Float64Array>>;
  /** For each row, how often anything but its numbers has changed. */
  readonly changes: Uint32Array;
  readonly #schema: Schema;
  readonly #profileLimits: ValueLimits;
  readonly #latches: readonly { cur: LevelLatch; temp: LevelLatch }[];
  readonly #flagsOfMask = new Map<number, readonly Flag[]>();
  readonly #columns: Columns;
  readonly #tolerances: readonly (number | null)[];
  /** The thresholds of each row, cached for the limits `of`. */
  #thresholds: { of: ValueLimits; cur: (Threshold | null)[]; temp: (Threshold | null)[] } | null = null;
  readonly #homedBit: number;
  readonly #enabledBit: number;
  readonly #complianceBit: number;

  constructor(schema: Schema) {
    this.#schema = schema;
    this.#profileLimits = new ValueLimits(schema.mapping);
    const main = schema.field('pos') ?? schema.field('ref');
    const column = (name: string): Field | null => {
      const field = schema.field(name);
      return main !== null && field !== null && field.labelSet === main.labelSet ? field : null;
    };
    this.#columns = Object.fromEntries(
      [...NUMBERS, 'flags'].map((name) => [name, name === 'error' ? null : column(name)]),
    ) as Columns;
    const bits = this.#columns.flags?.bits ?? [];
    this.#homedBit = bits.indexOf('homed');
    this.#enabledBit = bits.indexOf('enabled');
    this.#complianceBit = bits.indexOf('comply');
    this.rows = (main?.labels ?? []).map((label) => ({
      label,
      homed: null,
      enabled: null,
      flags: NO_FLAGS,
      level: 'ok',
      curLevel: 'ok',
      tempLevel: 'ok',
      compliant: false,
      apart: false,
    }));
    this.numbers = Object.fromEntries(
      NUMBERS.map((name) => [name, new Float64Array(this.rows.length).fill(Number.NaN)]),
    ) as Record<NumberName, Float64Array>;
    this.changes = new Uint32Array(this.rows.length);
    this.#latches = this.rows.map(() => ({ cur: new LevelLatch(), temp: new LevelLatch() }));
    this.#tolerances = this.rows.map(({ label }) => schema.mapping.tolerance(label));
  }

  /** Whether the robot reports this column at all; the page omits the others. */
  has(column: NumberName | 'flags' | 'homed' | 'enabled'): boolean {
    switch (column) {
      case 'error':
        return this.#columns.ref !== null && this.#columns.pos !== null;
      case 'homed':
        return this.#homedBit >= 0;
      case 'enabled':
        return this.#enabledBit >= 0;
      default:
        return this.#columns[column] !== null;
    }
  }

  /** The field of a column of numbers; null for `error`, which is computed, and for columns that the robot does not report. */
  column(name: NumberName): Field | null {
    return this.#columns[name];
  }

  /** Reads a frame's codes into `rows`, `numbers` and `changes`. */
  read(codes: Int32Array, limits: ValueLimits = this.#profileLimits): readonly JointRow[] {
    const { ref, pos, error, cur, temp } = this.numbers;
    for (const name of NUMBERS) readColumn(codes, this.#columns[name], this.numbers[name]);
    const thresholds = this.#thresholdsOf(limits);
    for (let i = 0; i < this.rows.length; i += 1) {
      const row = this.rows[i]!;
      const { flags, curLevel, tempLevel, apart } = row;
      error[i] = ref[i]! - pos[i]!;
      const mask = valueAt(codes, this.#columns.flags, i);
      row.homed = this.#bit(mask, this.#homedBit);
      row.enabled = this.#bit(mask, this.#enabledBit);
      row.flags = mask === null ? NO_FLAGS : this.#named(mask);
      const latches = this.#latches[i]!;
      row.curLevel = latches.cur.next(thresholds.cur[i]!, cur[i]!);
      row.tempLevel = latches.temp.next(thresholds.temp[i]!, temp[i]!);
      row.compliant = this.#bit(mask, this.#complianceBit) === true;
      row.apart = !row.compliant && isApart(error[i]!, apart, this.#tolerances[i]!);
      row.level = levelOfRow(row);
      // Flag lists are cached by their bit mask, so comparing the lists by identity is enough.
      const same = flags === row.flags && curLevel === row.curLevel && tempLevel === row.tempLevel;
      if (!same || apart !== row.apart) this.changes[i]! += 1;
    }
    return this.rows;
  }

  /** The thresholds of all rows, looked up once for each set of limits instead of in every frame. */
  #thresholdsOf(limits: ValueLimits) {
    if (this.#thresholds?.of !== limits) {
      const of = (field: string) => this.rows.map(({ label }) => limits.threshold(field, label));
      this.#thresholds = { of: limits, cur: of('cur'), temp: of('temp') };
    }
    return this.#thresholds;
  }

  #bit(mask: number | null, bit: number): boolean | null {
    return mask === null || bit < 0 ? null : (mask & (1 << bit)) !== 0;
  }

  #named(mask: number): readonly Flag[] {
    const known = this.#flagsOfMask.get(mask);
    if (known !== undefined) return known;
    const flags = (this.#columns.flags?.bitsSet(mask) ?? [])
      .filter((name) => !SHOWN_AS_COLUMNS.has(name))
      .map((name) => ({
        name,
        words: flagWords(name),
        severity: this.#schema.mapping.severity('flags', name),
      }))
      .sort((a, b) => RANK[a.severity] - RANK[b.severity]);
    // A robot uses a handful of masks; one that uses all of them must not fill the memory.
    if (this.#flagsOfMask.size >= 256) this.#flagsOfMask.clear();
    this.#flagsOfMask.set(mask, flags);
    return flags;
  }
}

function readColumn(codes: Int32Array, field: Field | null, into: Float64Array): void {
  if (field === null) return;
  for (let i = 0; i < into.length; i += 1) {
    const code = codes[field.start + i]!;
    into[i] = code === MISSING ? Number.NaN : code * field.scale;
  }
}

/** Whether a joint deviates from its command by more than its tolerance, with hysteresis. Without a reading (NaN) it does not. */
function isApart(error: number, before: boolean, tolerated: number | null): boolean {
  return tolerated !== null && Math.abs(error) > tolerated * (before ? CLOSE_AGAIN : 1);
}

function levelOfRow(row: JointRow): JointRow['level'] {
  const worst = row.flags[0]?.severity;
  if (worst === 'fault' || row.curLevel === 'fault' || row.tempLevel === 'fault') return 'fault';
  if (worst === 'caution' || row.curLevel === 'caution' || row.tempLevel === 'caution' || row.apart) {
    return 'caution';
  }
  return 'ok';
}
