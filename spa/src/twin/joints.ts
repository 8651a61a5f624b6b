import { type Field, type Level, MISSING, type Schema, type Severity } from '@posecast/wire';
import { flagWords } from './format.ts';
import { LevelLatch, type Threshold, ValueLimits, worseOf } from './limits.ts';
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
  /** By number, for those that are compared with limits. */
  readonly levels: Record<LimitedName, Level>;
  /** The joint is compliant on purpose, so a deviation from its command is no fault. */
  compliant: boolean;
  /** It deviates from its command by more than the profile's tolerance, and is not compliant. */
  apart: boolean;
}

/** A number of a joint: a column of the table, a line of its card, a value to plot and, unless it is computed, a field of the
 *  schema. Its words have its name in their keys (`pos`, `posWhat`, `posName`, `posMeans`; `columns.pos` in the explanations). */
interface JointNumber {
  readonly name: string;
  /** One number minus another, with that one's unit and resolution. */
  readonly computed?: { readonly of: string; readonly minus: string };
  /** What it is compared with. A row with `limits` also needs the words `curFault`, `curSentence` and `curOfAll`. */
  readonly judged?: 'limits' | 'tolerance';
  /** Its value in a motor at rest, where the colours of the body start; and how far limits can be set without the profile's. */
  readonly rest?: number;
  readonly span?: number;
  /** Its place in the card. */
  readonly place: number;
  /** The card draws its last minute, over at least this range, so that noise looks like a flat line. */
  readonly leastRange?: number;
  /** The number drawn behind it. */
  readonly beside?: string;
  /** Shown while presenting: above the others, or among them. */
  readonly presented?: 'first' | 'also';
  /** The width of its column in `joints.css`, and when a narrow table leaves it to the card. */
  readonly wide: 'angle' | 'rate' | 'small' | 'tiny';
  readonly yields?: 'some' | 'more' | 'narrowest';
}

/** The numbers of a joint, in the order of the table's columns. */
export const NUMBERS = [
  { name: 'ref', place: 2, presented: 'also', wide: 'angle' },
  { name: 'pos', place: 1, presented: 'first', wide: 'angle', leastRange: 0.02, beside: 'ref' },
  {
    name: 'error',
    ...{
      computed: { of: 'ref', minus: 'pos' },
      judged: 'tolerance',
      place: 3,
      wide: 'angle',
      yields: 'more',
    },
  },
  { name: 'vel', place: 4, presented: 'also', wide: 'rate', yields: 'some' },
  { name: 'effort', place: 5, presented: 'also', wide: 'rate', yields: 'some' },
  {
    name: 'cur',
    ...{ judged: 'limits', rest: 0, span: 20, place: 6, presented: 'also', wide: 'small', leastRange: 0.5 },
  },
  {
    name: 'temp',
    ...{
      judged: 'limits',
      rest: 20,
      span: 120,
      place: 7,
      presented: 'also',
      wide: 'tiny',
      yields: 'narrowest',
    },
  },
] as const satisfies readonly JointNumber[];
type Row = (typeof NUMBERS)[number];
export type NumberName = Row['name'];
/** A number with limits. */
export type LimitedName = Extract<Row, { judged: 'limits' }>['name'];

/** The number of this name; undefined: no number of a joint. */
export function numberOf(name: string): JointNumber | undefined {
  return NUMBERS.find((row) => row.name === name);
}

/** The field whose unit and resolution a number has. */
export function fieldOfNumber(name: string): string {
  return numberOf(name)?.computed?.minus ?? name;
}

/** The names of the numbers with limits. */
export function limitedNames(): readonly LimitedName[] {
  return NUMBERS.flatMap((row) => ('judged' in row && row.judged === 'limits' ? row.name : []));
}

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
  readonly #limited = limitedNames().map((name) => ({ name, latches: [] as LevelLatch[] }));
  readonly #flagsOfMask = new Map<number, readonly Flag[]>();
  readonly #columns: Columns;
  readonly #tolerances: readonly (number | null)[];
  /** The thresholds of each row, cached for the limits `of`. */
  #thresholds: { of: ValueLimits; rows: Record<LimitedName, (Threshold | null)[]> } | null = null;
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
      [...NUMBERS.map(({ name }) => name), 'flags'].map((name) => [
        name,
        numberOf(name)?.computed === undefined ? column(name) : null,
      ]),
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
      levels: byName(() => 'ok'),
      compliant: false,
      apart: false,
    }));
    this.numbers = Object.fromEntries(
      NUMBERS.map(({ name }) => [name, new Float64Array(this.rows.length).fill(Number.NaN)]),
    ) as Record<NumberName, Float64Array>;
    this.changes = new Uint32Array(this.rows.length);
    for (const { latches } of this.#limited) latches.push(...this.rows.map(() => new LevelLatch()));
    this.#tolerances = this.rows.map(({ label }) => schema.mapping.tolerance(label));
  }

  /** Whether the robot reports this column at all; the page omits the others. */
  has(column: NumberName | 'flags' | 'homed' | 'enabled'): boolean {
    switch (column) {
      case 'homed':
        return this.#homedBit >= 0;
      case 'enabled':
        return this.#enabledBit >= 0;
      default: {
        const { of = column, minus = column } = numberOf(column)?.computed ?? {};
        return this.#columns[of as NumberName] !== null && this.#columns[minus as NumberName] !== null;
      }
    }
  }

  /** The field of a column of numbers; null for a computed one, and for columns that the robot does not report. */
  column(name: NumberName): Field | null {
    return this.#columns[name];
  }

  /** Reads a frame's codes into `rows`, `numbers` and `changes`. */
  read(codes: Int32Array, limits: ValueLimits = this.#profileLimits): readonly JointRow[] {
    for (const { name } of NUMBERS) readColumn(codes, this.#columns[name], this.numbers[name]);
    for (const { name, computed } of NUMBERS as readonly JointNumber[])
      if (computed !== undefined) subtract(this.numbers, name as NumberName, computed);
    const { error } = this.numbers;
    const thresholds = this.#thresholdsOf(limits);
    for (let i = 0; i < this.rows.length; i += 1) {
      const row = this.rows[i]!;
      const { flags, apart } = row;
      const mask = valueAt(codes, this.#columns.flags, i);
      row.homed = this.#bit(mask, this.#homedBit);
      row.enabled = this.#bit(mask, this.#enabledBit);
      row.flags = mask === null ? NO_FLAGS : this.#named(mask);
      let isSame = true;
      for (const { name, latches } of this.#limited) {
        const before = row.levels[name];
        row.levels[name] = latches[i]!.next(thresholds[name][i]!, this.numbers[name][i]!);
        isSame &&= before === row.levels[name];
      }
      row.compliant = this.#bit(mask, this.#complianceBit) === true;
      row.apart = !row.compliant && isApart(error[i]!, apart, this.#tolerances[i]!);
      row.level = levelOfRow(row);
      // Flag lists are cached by their bit mask, so comparing the lists by identity is enough.
      if (!isSame || flags !== row.flags || apart !== row.apart) this.changes[i]! += 1;
    }
    return this.rows;
  }

  /** The thresholds of all rows, looked up once for each set of limits instead of in every frame. */
  #thresholdsOf(limits: ValueLimits) {
    if (this.#thresholds?.of !== limits) {
      const of = (field: string) => this.rows.map(({ label }) => limits.threshold(field, label));
      this.#thresholds = { of: limits, rows: byName(of) };
    }
    return this.#thresholds.rows;
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

/** One value for each number with limits. */
function byName<T>(of: (name: LimitedName) => T): Record<LimitedName, T> {
  return Object.fromEntries(limitedNames().map((name) => [name, of(name)])) as Record<LimitedName, T>;
}

function subtract(
  numbers: Readonly<Record<string, Float64Array>>,
  name: NumberName,
  { of, minus }: { readonly of: string; readonly minus: string },
): void {
  const [into, whole, less] = [numbers[name]!, numbers[of]!, numbers[minus]!];
  for (let i = 0; i < into.length; i += 1) into[i] = whole[i]! - less[i]!;
}

/** Whether a joint deviates from its command by more than its tolerance, with hysteresis. Without a reading (NaN) it does not. */
function isApart(error: number, before: boolean, tolerated: number | null): boolean {
  return tolerated !== null && Math.abs(error) > tolerated * (before ? CLOSE_AGAIN : 1);
}

function levelOfRow(row: JointRow): JointRow['level'] {
  const worst = row.flags[0]?.severity;
  const { levels } = row;
  let level: Level = worst === 'fault' ? 'fault' : worst === 'caution' || row.apart ? 'caution' : 'ok';
  for (const name in levels) level = worseOf(level, levels[name as LimitedName]);
  return level;
}
