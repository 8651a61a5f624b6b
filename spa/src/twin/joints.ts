import type { Field, Level, Schema, Severity } from '@posecast/wire';
import { flagWords } from './format.ts';
import { LevelLatch } from './level_latch.ts';
import { Limits, type Threshold } from './limits.ts';
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
  ref: number | null;
  pos: number | null;
  /** ref − pos. */
  error: number | null;
  vel: number | null;
  effort: number | null;
  cur: number | null;
  temp: number | null;
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

/** What comes straight from a field. */
type Measured = 'ref' | 'pos' | 'vel' | 'effort' | 'cur' | 'temp';

const RANK: Readonly<Record<Severity, number>> = { fault: 0, caution: 1, state: 2 };
/** Of the tolerance: how far ref and pos must come together again before a deviation counts as gone. */
export const CLOSE_AGAIN = 0.8;
const SHOWN_AS_COLUMNS = new Set(['homed', 'enabled']);
const NO_FLAGS: readonly Flag[] = [];

/** The rows of the joint table for one schema. `read` rewrites them in place: no garbage at frame rate. */
export class JointTable {
  readonly rows: readonly JointRow[];
  readonly #schema: Schema;
  readonly #profileLimits: Limits;
  readonly #latches: readonly { cur: LevelLatch; temp: LevelLatch }[];
  readonly #flagsOfMask = new Map<number, readonly Flag[]>();
  readonly #columns: Readonly<Record<Measured | 'flags', Field | null>>;
  readonly #tolerances: readonly (number | null)[];
  /** Of each row, while the same limits hold. */
  #thresholds: { of: Limits; cur: (Threshold | null)[]; temp: (Threshold | null)[] } | null = null;
  readonly #homedBit: number;
  readonly #enabledBit: number;
  readonly #complianceBit: number;

  constructor(schema: Schema) {
    this.#schema = schema;
    this.#profileLimits = new Limits(schema.mapping);
    const main = schema.field('pos') ?? schema.field('ref');
    const column = (name: string): Field | null => {
      const field = schema.field(name);
      return main !== null && field !== null && field.labelSet === main.labelSet ? field : null;
    };
    this.#columns = {
      ref: column('ref'),
      pos: column('pos'),
      vel: column('vel'),
      effort: column('effort'),
      cur: column('cur'),
      temp: column('temp'),
      flags: column('flags'),
    };
    const bits = this.#columns.flags?.bits ?? [];
    this.#homedBit = bits.indexOf('homed');
    this.#enabledBit = bits.indexOf('enabled');
    this.#complianceBit = bits.indexOf('comply');
    this.rows = (main?.labels ?? []).map((label) => ({
      label,
      plain: schema.mapping.names.get(label) ?? null,
      ref: null,
      pos: null,
      error: null,
      vel: null,
      effort: null,
      cur: null,
      temp: null,
      homed: null,
      enabled: null,
      flags: NO_FLAGS,
      level: 'ok',
      curLevel: 'ok',
      tempLevel: 'ok',
      compliant: false,
      apart: false,
    }));
    this.#latches = this.rows.map(() => ({ cur: new LevelLatch(), temp: new LevelLatch() }));
    this.#tolerances = this.rows.map(({ label }) => schema.mapping.tolerance(label));
  }

  /** Whether the robot reports this at all: a column that never has a reading is not worth its room. */
  has(column: Measured | 'error' | 'flags' | 'homed' | 'enabled'): boolean {
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

  /** Where a column of numbers comes from; null when the robot does not report it. */
  column(name: Measured): Field | null {
    return this.#columns[name];
  }

  read(codes: Int32Array, limits: Limits = this.#profileLimits): readonly JointRow[] {
    const { ref, pos, vel, effort, cur, temp, flags } = this.#columns;
    const thresholds = this.#thresholdsOf(limits);
    for (let i = 0; i < this.rows.length; i += 1) {
      const row = this.rows[i]!;
      row.ref = valueAt(codes, ref, i);
      row.pos = valueAt(codes, pos, i);
      row.error = row.ref === null || row.pos === null ? null : row.ref - row.pos;
      row.vel = valueAt(codes, vel, i);
      row.effort = valueAt(codes, effort, i);
      row.cur = valueAt(codes, cur, i);
      row.temp = valueAt(codes, temp, i);
      const mask = valueAt(codes, flags, i);
      row.homed = this.#bit(mask, this.#homedBit);
      row.enabled = this.#bit(mask, this.#enabledBit);
      row.flags = mask === null ? NO_FLAGS : this.#named(mask);
      const latches = this.#latches[i]!;
      row.curLevel = latches.cur.next(thresholds.cur[i]!, row.cur);
      row.tempLevel = latches.temp.next(thresholds.temp[i]!, row.temp);
      row.compliant = this.#bit(mask, this.#complianceBit) === true;
      row.apart = !row.compliant && this.#isApart(row, this.#tolerances[i]!);
      row.level = levelOfRow(row);
    }
    return this.rows;
  }

  /** Looked up once, not in every frame. */
  #thresholdsOf(limits: Limits) {
    if (this.#thresholds?.of !== limits) {
      const of = (field: string) => this.rows.map(({ label }) => limits.threshold(field, label));
      this.#thresholds = { of: limits, cur: of('cur'), temp: of('temp') };
    }
    return this.#thresholds;
  }

  #isApart({ error, apart }: JointRow, tolerated: number | null): boolean {
    if (tolerated === null || error === null) return false;
    return Math.abs(error) > tolerated * (apart ? CLOSE_AGAIN : 1);
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

function levelOfRow(row: JointRow): JointRow['level'] {
  const worst = row.flags[0]?.severity;
  if (worst === 'fault' || row.curLevel === 'fault' || row.tempLevel === 'fault') return 'fault';
  if (worst === 'caution' || row.curLevel === 'caution' || row.tempLevel === 'caution' || row.apart) {
    return 'caution';
  }
  return 'ok';
}
