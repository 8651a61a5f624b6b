import type { Fault } from '../../../twin/alarms/fault_log.ts';
import { displayOf, formatSpan } from '../../../twin/format.ts';
import type { JointRow, NUMBERS, NumberName } from '../../../twin/joints.ts';
import { isolated } from '../../../twin/names.ts';
import { createElement, DataAttribute, TextCell } from '../../shell/cells.ts';
import { say } from '../../text/language.ts';
import { faultWords } from '../../words/fault.ts';

/** A row stays on top this long after its fault, even if acknowledged, because rows that jump can't be read. */
const STAYS_ON_TOP_MS = 5000;
/** Only a caution that lasts this long moves a row up, because a walking robot's joints briefly lag now and then. */
const CAUTION_LASTS_MS = 1000;

/** Flag: the row has a fault that is not acknowledged. */
const OPEN = 4;
const LEVELS: readonly JointRow['level'][] = ['ok', 'caution', 'fault'];

/** Ranks the rows of a table. It is called for each row at each update, so its data is in typed arrays. */
export class Ranks {
  /** 0: normal, 1: caution, 2: fault; plus the OPEN flag. */
  readonly #levels: Uint8Array;
  readonly #faultMs: Float64Array;
  readonly #cautionMs: Float64Array;
  readonly #cautionSinceMs: Float64Array;

  constructor(rows: number) {
    const never = () => new Float64Array(rows).fill(Number.NEGATIVE_INFINITY);
    this.#levels = new Uint8Array(rows);
    this.#faultMs = never();
    this.#cautionMs = never();
    this.#cautionSinceMs = never();
  }

  set(i: number, level: JointRow['level'], open: boolean): void {
    this.#levels[i] = LEVELS.indexOf(level) | (open ? OPEN : 0);
  }

  /** 2: a fault now or until just now; 1: caution; 0: normal. */
  of(i: number, nowMs: number): 0 | 1 | 2 {
    const held = this.#levels[i]!;
    const level = held & ~OPEN;
    if (level === 2) this.#faultMs[i] = nowMs;
    else if (level === 1) {
      if (nowMs - this.#cautionMs[i]! > STAYS_ON_TOP_MS) this.#cautionSinceMs[i] = nowMs;
      this.#cautionMs[i] = nowMs;
    }
    if (held !== level || nowMs - this.#faultMs[i]! < STAYS_ON_TOP_MS) return 2;
    const lasted = this.#cautionMs[i]! - this.#cautionSinceMs[i]! >= CAUTION_LASTS_MS;
    return lasted && nowMs - this.#cautionMs[i]! < STAYS_ON_TOP_MS ? 1 : 0;
  }
}

/** The age is shown for readings lost longer than this. */
const OLD_MS = 1500;

export const STATES = ['homed', 'enabled'] as const;
export type StateName = (typeof STATES)[number];

/** A column of a row that has no reading now, and the time of its last one. */
export interface Lost {
  readonly name: NumberName;
  readonly sinceMs: number;
}

/** The classes of a column's cells; see `joints.css`. */
export function classOf(number: (typeof NUMBERS)[number]): string {
  const yields = 'yields' in number ? ` yields-${number.yields}` : '';
  return `c-num c-${number.name} c-${number.wide}${yields}${'computed' in number ? ' c-computed' : ''}`;
}

/** One row of the joint table. It remembers what it shows, and writes to the DOM only what changes. */
export class RowView {
  readonly element: HTMLTableRowElement;
  /** The button that shows the joint's name. */
  readonly button: HTMLElement;
  readonly label: string;
  /** The label, or the joint's plain name if the viewer prefers words. */
  readonly name: string;
  /** The text that the filter searches, in lower case; it changes with the flags. */
  haystack = '';
  readonly #named: string;
  /** The cells of its numbers, in the order of the columns. */
  readonly numbers: readonly HTMLElement[];
  readonly #states: readonly (readonly [name: StateName, cell: TextCell])[];
  readonly #marks: readonly (readonly [name: NumberName, mark: DataAttribute])[];
  readonly #flags: TextCell;
  readonly #level: DataAttribute;
  readonly #latched: DataAttribute;
  #fault: Fault | null = null;
  #clearedMs: number | null = null;
  #old = '';

  constructor(
    row: JointRow,
    name: string,
    /** The profile's name for it, safe to show. */
    plain: string | null,
    limb: string,
    /** The unit of a number if it differs from the column's unit; it then follows the number. */
    ownUnit: (field: NumberName) => string | null,
    numbers: readonly (typeof NUMBERS)[number][],
    states: readonly StateName[],
  ) {
    this.label = row.label;
    this.#named = `${row.label} ${plain ?? name} ${limb}`;
    this.haystack = this.#named.toLowerCase();
    const element = createElement('tr', '');
    element.dataset.label = row.label;
    const head = createElement('th', 'c-joint');
    head.scope = 'row';
    this.name = name;
    const open = createElement('button', '', isolated(name));
    open.type = 'button';
    head.append(open);
    this.button = open;
    head.title = plain === null ? isolated(row.label) : `${isolated(row.label)} · ${plain}`;
    element.append(head);
    const marks: [NumberName, DataAttribute][] = [];
    const cell = (field: string, className: string) => {
      const td = createElement('td', className);
      td.dataset.field = field;
      td.dataset.label = row.label;
      element.append(td);
      return td;
    };
    this.numbers = numbers.map((number) => {
      const { name: field } = number;
      const td = cell(field, classOf(number));
      td.draggable = true; // starts a drag into a plot
      const unit = ownUnit(field);
      if (unit !== null) td.dataset.unit = displayOf(unit, 'rad').unit;
      if ('judged' in number) marks.push([field, new DataAttribute(td, 'level')]);
      return td;
    });
    this.#marks = marks;
    this.#states = states.map((field) => [field, new TextCell(cell(field, 'c-state'))]);
    const flags = createElement('span', ''); // two lines in one cell
    cell('flags', 'c-flags').append(flags);
    this.#flags = new TextCell(flags);
    this.element = element;
    this.#level = new DataAttribute(element, 'level');
    this.#latched = new DataAttribute(element, 'latched');
  }

  /** Writes faults and states. `anew`: the row has changed. */
  write(row: JointRow, fault: Fault | null, old: string, anew: boolean): void {
    const clearedMs = fault?.clearedMs ?? null;
    if (!anew && fault === this.#fault && clearedMs === this.#clearedMs && old === this.#old) return;
    this.#fault = fault;
    this.#clearedMs = clearedMs;
    this.#old = old;
    const { level } = row;
    const parts = row.flags.map((flag) => flag.words);
    if (fault !== null && clearedMs !== null) parts.unshift(say().clearedFlag(faultWords(fault)));
    if (old !== '') parts.unshift(old);
    const words = parts.join(', ');
    this.#flags.set(words);
    const rank = level === 'ok' ? '' : `${level} ${say()[level]}`;
    this.haystack = `${this.#named} ${words} ${rank}`.toLowerCase();
    this.#level.set(level);
    this.#latched.set(fault === null ? '' : clearedMs === null ? 'lasts' : 'over');
    const levels: Partial<Record<NumberName, string>> = row.levels;
    for (const [name, mark] of this.#marks) mark.set(levels[name] ?? (row.apart ? 'caution' : 'ok'));
    for (const [name, cell] of this.#states) {
      const state = row[name];
      cell.set(state === null ? '—' : state ? '✓' : say().no);
    }
  }
}

/** "pos, cur 12 s old": which readings are lost, and how long ago the first one was. */
export function oldWords(lost: readonly Lost[], nowMs: number): string {
  const told = lost.filter(({ sinceMs }) => nowMs - sinceMs >= OLD_MS);
  if (told.length === 0) return '';
  const age = nowMs - Math.min(...told.map(({ sinceMs }) => sinceMs));
  const names = told.map(({ name }) => say()[name]).join(', ');
  return say().old(names, formatSpan(Math.floor(age / 1000) * 1000));
}
