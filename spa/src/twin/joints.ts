import { type Field, type Level, MISSING, type Schema, type Severity } from '@posecast/wire';
import { flagWords } from './format.ts';
import { LevelLatch } from './limits/level_latch.ts';
import { type Threshold, ValueLimits } from './limits/limits.ts';
import { plainName } from './names.ts';
import { valueAt } from './values.ts';

export interface Flag {
  /** As the robot says it. */
  name: string;
  /** As a person reads it. */
  words: string;
  severity: Severity;
}

export interface JointRow {
  readonly label: string;
  /** The plain name ("right knee"), when the profile has one. */
  readonly plain: string | null;
  homed: boolean | null;
  enabled: boolean | null;
  /** What is set and worth saying: faults first, then cautions, then states other than homed and enabled. */
  flags: readonly Flag[];
  /** The worst of flags and limits. */
  level: Level;
  curLevel: Level;
  tempLevel: Level;
  /** Yields on purpose: where it is then is no fault of its. */
  compliant: boolean;
  /** Further from its command than the profile tolerates, and not on purpose. */
  apart: boolean;
}

/** Columns of numbers, as the table has them. All but `error`, which is ref − pos, come straight from a field. */
export const NUMBERS = ['ref', 'pos', 'error', 'vel', 'effort', 'cur', 'temp'] as const;
export type NumberName = (typeof NUMBERS)[number];
type Columns = Readonly<Record<NumberName | 'flags', Field | null>>;

const RANK: Readonly<Record<Severity, number>> = { fault: 0, caution: 1, state: 2 };
/** Of the tolerance: how far ref and pos must come together again before a deviation counts as gone. */
export const CLOSE_AGAIN = 0.8;
const SHOWN_AS_COLUMNS = new Set(['homed', 'enabled']);
const NO_FLAGS: readonly Flag[] = [];

/** The rows of the joint table for one schema. `read` rewrites them in place: no garbage at frame rate. */
export class JointTable {
  readonly rows: readonly JointRow[];
  /** Column by column, row by row, side by side in memory; NaN is no reading. */
  readonly numbers: Readonly<Record<NumberName, Float64Array>>;
  /** Of each row: counts how often anything but its numbers has changed. */
  readonly changes: Uint32Array;
  readonly #schema: Schema;
  readonly #profileLimits: ValueLimits;
  readonly #latches: readonly { cur: LevelLatch; temp: LevelLatch }[];
  readonly #flagsOfMask = new Map<number, readonly Flag[]>();
  readonly #columns: Columns;
  readonly #tolerances: readonly (number | null)[];
  /** Of each row, while the same limits hold. */
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
      plain: plainName(schema, label) ?? null,
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

  /** Whether the robot reports this at all: a column that never has a reading is not worth its room. */
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

  /** Where a column of numbers comes from; null when the robot does not report it, and of what is computed. */
  column(name: NumberName): Field | null {
    return this.#columns[name];
  }

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
      // Flags, homed and enabled come of one reading: other flags are another list.
      const same = flags === row.flags && curLevel === row.curLevel && tempLevel === row.tempLevel;
      if (!same || apart !== row.apart) this.changes[i]! += 1;
    }
    return this.rows;
  }

  /** Looked up once, not in every frame. */
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
    // A robot has a handful of masks; one that walks through all of them must not fill the memory.
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

/** Nothing is apart that has no reading. */
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
