import type { Fault } from '../../twin/fault_book.ts';
import { formatSpan } from '../../twin/format.ts';
import type { JointRow } from '../../twin/joints.ts';
import { faultWords } from '../fault_words.ts';
import { say } from '../language.ts';
import { DataMark, make, TextCell } from './cells.ts';

/** A row that was faulty stays on top this long after, also when acknowledged: rows that hop can't be read. */
const STAYS_ON_TOP_MS = 5000;
/** What passes at once brings no row to the top: a walking robot's joints are now and then late. */
const CAUTION_LASTS_MS = 1000;
/** From here on a reading that is gone says how old it is. */
const OLD_MS = 1500;

export const NUMBERS = ['ref', 'pos', 'error', 'vel', 'effort', 'cur', 'temp'] as const;
export type NumberName = (typeof NUMBERS)[number];
export const STATES = ['homed', 'enabled'] as const;
export type StateName = (typeof STATES)[number];
const POSITIONS: ReadonlySet<NumberName> = new Set(['ref', 'pos', 'error']);

/** A column of a row that nothing is read of now, and since when. */
export interface Lost {
  readonly name: NumberName;
  readonly sinceMs: number;
}

/** One joint of the table. It remembers what it shows, and touches the page where that changes. */
export class RowView {
  readonly element: HTMLTableRowElement;
  readonly label: string;
  /** Whether somebody has yet to acknowledge a fault of it. */
  open = false;
  /** What a filter looks through, in lower case; flags come and go. */
  haystack = '';
  readonly #named: string;
  /** Where its numbers go, in the order of the columns. */
  readonly numbers: readonly HTMLElement[];
  readonly #states: readonly (readonly [name: StateName, cell: TextCell])[];
  readonly #error: DataMark | null;
  readonly #cur: DataMark | null;
  readonly #temp: DataMark | null;
  readonly #flags: TextCell;
  readonly #level: DataMark;
  readonly #latched: DataMark;
  /** What is said. Flags, homed and enabled come of one reading: other flags are another list. */
  #flags0: JointRow['flags'] | undefined;
  #curLevel0: string | undefined;
  #tempLevel0: string | undefined;
  #apart0: boolean | undefined;
  #fault0: Fault | null | undefined;
  #cleared0: number | null | undefined;
  #old0: string | undefined;
  #faultMs = Number.NEGATIVE_INFINITY;
  #cautionMs = Number.NEGATIVE_INFINITY;
  #cautionSinceMs = Number.NEGATIVE_INFINITY;

  constructor(
    row: JointRow,
    limb: string,
    /** Of its positions, when it is not the column's: it stands behind the number then. */
    ownUnit: string | null,
    numbers: readonly NumberName[],
    states: readonly StateName[],
  ) {
    this.label = row.label;
    this.#named = `${row.label} ${row.plain ?? ''} ${limb}`;
    this.haystack = this.#named.toLowerCase();
    const element = make('tr', '');
    element.dataset.label = row.label;
    const name = make('th', 'c-joint');
    name.scope = 'row';
    const open = make('button', '', row.label);
    open.type = 'button';
    name.append(open);
    name.title = row.plain ?? row.label;
    element.append(name);
    const marks: Partial<Record<NumberName, DataMark>> = {};
    const cell = (field: string, className: string) => {
      const td = make('td', className);
      td.dataset.field = field;
      td.dataset.label = row.label;
      element.append(td);
      return td;
    };
    this.numbers = numbers.map((field) => {
      const td = cell(field, `c-num c-${field}`);
      td.draggable = true; // into a plot
      if (ownUnit !== null && POSITIONS.has(field)) td.dataset.unit = ownUnit;
      marks[field] = new DataMark(td, 'level');
      return td;
    });
    this.#error = marks.error ?? null;
    this.#cur = marks.cur ?? null;
    this.#temp = marks.temp ?? null;
    this.#states = states.map((field) => [field, new TextCell(cell(field, 'c-state'))]);
    this.#flags = new TextCell(cell('flags', 'c-flags'));
    this.element = element;
    this.#level = new DataMark(element, 'level');
    this.#latched = new DataMark(element, 'latched');
  }

  /** What is wrong with it, and its states. An unchanged row costs a comparison for each. */
  write(row: JointRow, fault: Fault | null, old: string, nowMs: number): void {
    const { flags, level, curLevel, tempLevel, apart } = row;
    const clearedMs = fault?.clearedMs;
    if (
      flags !== this.#flags0 ||
      curLevel !== this.#curLevel0 ||
      tempLevel !== this.#tempLevel0 ||
      apart !== this.#apart0 ||
      fault !== this.#fault0 ||
      clearedMs !== this.#cleared0 ||
      old !== this.#old0
    ) {
      this.#flags0 = flags;
      this.#curLevel0 = curLevel;
      this.#tempLevel0 = tempLevel;
      this.#apart0 = apart;
      this.#fault0 = fault;
      this.#cleared0 = clearedMs;
      this.#old0 = old;
      this.#say(row, fault, old);
    }
    if (level === 'fault') this.#faultMs = nowMs;
    if (level === 'caution') {
      if (nowMs - this.#cautionMs > STAYS_ON_TOP_MS) this.#cautionSinceMs = nowMs;
      this.#cautionMs = nowMs;
    }
  }

  #say(row: JointRow, fault: Fault | null, old: string): void {
    const { level } = row;
    const parts = row.flags.map((flag) => flag.words);
    if (fault !== null && fault.clearedMs !== null) parts.unshift(say().over(faultWords(fault)));
    if (old !== '') parts.unshift(old);
    const words = parts.join(', ');
    this.#flags.set(words);
    const rank = level === 'ok' ? '' : `${level} ${say()[level]}`;
    this.haystack = `${this.#named} ${words} ${rank}`.toLowerCase();
    this.#level.set(level);
    this.#latched.set(fault === null ? '' : fault.clearedMs === null ? 'lasts' : 'over');
    this.#error?.set(row.apart ? 'caution' : 'ok');
    this.#cur?.set(row.curLevel);
    this.#temp?.set(row.tempLevel);
    for (const [name, cell] of this.#states) {
      const state = row[name];
      cell.set(state === null ? '—' : state ? '✓' : say().no);
    }
    this.open = fault !== null;
  }

  /** 2: faulty, or was until just now; 1: caution; 0: all well. */
  rank(nowMs: number): 0 | 1 | 2 {
    if (this.open || nowMs - this.#faultMs < STAYS_ON_TOP_MS) return 2;
    const lasted = this.#cautionMs - this.#cautionSinceMs >= CAUTION_LASTS_MS;
    return lasted && nowMs - this.#cautionMs < STAYS_ON_TOP_MS ? 1 : 0;
  }
}

/** "pos, cur 12 s old": which readings are gone, and how long ago the first of them was. */
export function oldWords(lost: readonly Lost[], nowMs: number): string {
  const told = lost.filter(({ sinceMs }) => nowMs - sinceMs >= OLD_MS);
  if (told.length === 0) return '';
  const age = nowMs - Math.min(...told.map(({ sinceMs }) => sinceMs));
  const names = told.map(({ name }) => say()[name]).join(', ');
  return say().old(names, formatSpan(Math.floor(age / 1000) * 1000));
}
