import { type Field, type Level, level, type Schema, type Severity } from '@posecast/wire';
import { flagWords } from './format.ts';
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
  /** Further from its command than the profile tolerates. */
  apart: boolean;
}

const RANK: Readonly<Record<Severity, number>> = { fault: 0, caution: 1, state: 2 };
const SHOWN_AS_COLUMNS = new Set(['homed', 'enabled']);
const NO_FLAGS: readonly Flag[] = [];

/** The rows of the joint table for one schema. `read` rewrites them in place: no garbage at frame rate. */
export class JointTable {
  readonly rows: readonly JointRow[];
  readonly #schema: Schema;
  readonly #flagsOfMask = new Map<number, readonly Flag[]>();
  readonly #columns: Readonly<Record<'ref' | 'pos' | 'cur' | 'temp' | 'flags', Field | null>>;
  readonly #homedBit: number;
  readonly #enabledBit: number;

  constructor(schema: Schema) {
    this.#schema = schema;
    const main = schema.field('pos') ?? schema.field('ref');
    const column = (name: string): Field | null => {
      const field = schema.field(name);
      return main !== null && field !== null && field.labelSet === main.labelSet ? field : null;
    };
    this.#columns = {
      ref: column('ref'),
      pos: column('pos'),
      cur: column('cur'),
      temp: column('temp'),
      flags: column('flags'),
    };
    const bits = this.#columns.flags?.bits ?? [];
    this.#homedBit = bits.indexOf('homed');
    this.#enabledBit = bits.indexOf('enabled');
    this.rows = (main?.labels ?? []).map((label) => ({
      label,
      plain: schema.mapping.names.get(label) ?? null,
      ref: null,
      pos: null,
      error: null,
      cur: null,
      temp: null,
      homed: null,
      enabled: null,
      flags: NO_FLAGS,
      level: 'ok',
      curLevel: 'ok',
      tempLevel: 'ok',
      apart: false,
    }));
  }

  /** Whether the robot reports this at all: a column that never has a reading is not worth its room. */
  has(column: 'ref' | 'pos' | 'error' | 'cur' | 'temp' | 'flags' | 'homed' | 'enabled'): boolean {
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

  read(codes: Int32Array): readonly JointRow[] {
    const { ref, pos, cur, temp, flags } = this.#columns;
    const { mapping } = this.#schema;
    this.rows.forEach((row, i) => {
      row.ref = valueAt(codes, ref, i);
      row.pos = valueAt(codes, pos, i);
      row.error = row.ref === null || row.pos === null ? null : row.ref - row.pos;
      row.cur = valueAt(codes, cur, i);
      row.temp = valueAt(codes, temp, i);
      const mask = valueAt(codes, flags, i);
      row.homed = this.#bit(mask, this.#homedBit);
      row.enabled = this.#bit(mask, this.#enabledBit);
      row.flags = mask === null ? NO_FLAGS : this.#named(mask);
      row.curLevel = this.#level('cur', row.label, row.cur);
      row.tempLevel = this.#level('temp', row.label, row.temp);
      const tolerated = mapping.tolerance(row.label);
      row.apart = tolerated !== null && row.error !== null && Math.abs(row.error) > tolerated;
      row.level = levelOfRow(row);
    });
    return this.rows;
  }

  #level(field: string, label: string, value: number | null): Level {
    const threshold = this.#schema.mapping.threshold(field, label);
    return threshold === null ? 'ok' : level(threshold, value);
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
