import { createStore } from '../../../kit.ts';
import type { FaultLog } from '../../../twin/alarms/fault_log.ts';
import { type Display, displayOf } from '../../../twin/format.ts';
import { fieldOfNumber, type JointTable, NUMBERS, type NumberName } from '../../../twin/joints.ts';
import type { Limb } from '../../../twin/limbs.ts';
import { plainName, wordsOfName } from '../../../twin/names.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import type { LastReadings } from '../../../twin/sensors/last_readings.ts';
import { valueAt } from '../../../twin/values.ts';
import { createTerm, createUnit } from '../../explain/terms.tsx';
import { createElement, NumberGrid, TextCell } from '../../shell/cells.ts';
import { settings } from '../../state/settings.ts';
import { onSelection, selection, selectJoint } from '../../state/viewing.ts';
import { languageTag, say } from '../../text/language.ts';
import { classOf, type Lost, oldWords, Ranks, RowView, STATES } from './joint_row.ts';
import { NameColumn, titledLimbs } from './name_column.ts';

/** The filter text of the joint table. It is kept as long as the page is open, also when the schema or the tab changes. */
const text = createStore('');
let words: readonly string[] = [];

/** Longest filter text; the rest is cut off. */
const LONGEST = 100;

export const filterText = text.get;
export const onFilter = text.subscribe;

export function setFilter(next: string): void {
  if (next === text.get()) return;
  const kept = next.slice(0, LONGEST);
  words = kept.toLowerCase().split(/\s+/).filter(Boolean);
  text.set(kept);
}

/** Whether `haystack` (lower case) contains every word of the filter. */
export function matchesFilter(haystack: string): boolean {
  return words.every((word) => haystack.includes(word));
}

/** Whether there is a filter text. */
export function hasFilter(): boolean {
  return words.length > 0;
}

/** What the table needs from the rest of the page. */
export interface TableSources {
  readonly faults?: FaultLog;
  readonly readings?: LastReadings;
  /** The time that the table shows, ms. */
  readonly nowMs?: () => number;
}

type Schema = NonNullable<RobotTwin['schema']>;

/** A column of numbers. */
interface Column {
  readonly name: NumberName;
  /** One value for each row. */
  readonly values: Float64Array;
  /** Its field; null for a computed column. */
  readonly field: ReturnType<JointTable['column']>;
  readonly unit: TextCell;
  display: Display;
  /** Units of individual rows, for channels with their own unit; null if there are none. */
  own: readonly (Display | null)[] | null;
}

/** The rank of a row that the filter hides. */
const HIDDEN = -1;
/** Rows off the screen are written in turns, every 20th at a time, so that each is written within two seconds. */
const TURNS = 20;
/** This long after the last frame, all remaining rows are written. */
const SETTLED_MS = 300;
const NOTHING_LOST: readonly Lost[] = [];

/** The joint table. It writes directly to the DOM, without React, because it changes with every frame. */
export class JointView {
  readonly #twin: RobotTwin;
  readonly #host: HTMLElement;
  readonly #from: TableSources;
  readonly #leave: readonly (() => void)[];
  #root: HTMLTableElement | null = null;
  #rows: readonly RowView[] = [];
  #grid: NumberGrid | null = null;
  #columns: readonly Column[] = [];
  /** The limbs; a limb with a fault comes before the others. */
  #bodies: { element: HTMLElement; rows: readonly number[]; isFirst: boolean }[] = [];
  #names: NameColumn | null = null;
  #nothing: HTMLElement | null = null;
  #builtFor: readonly unknown[] = [];
  #angle = '';
  #ranks = new Ranks(0);
  /** The shown rank of each row, or HIDDEN. */
  #shownRanks = new Int8Array(0);
  /** For each row, the change count at its last write. */
  #said = new Uint32Array(0);
  /** The fault version at the last write; NaN: write everything again. */
  #saidFaults = Number.NaN;
  /** Whether each row is on screen (1) or not (0). Writing to the DOM is the most expensive part of an update. */
  #seen = new Uint8Array(0);
  readonly #sight = new IntersectionObserver((changes) => this.#look(changes));
  #turn = 0;
  /** One timer for many frames, because setting a timer costs more than writing a row. */
  #settle: ReturnType<typeof setTimeout> | undefined;
  #settled = true;
  readonly #settleDown = () => {
    this.#settle = this.#settled ? undefined : setTimeout(this.#settleDown, SETTLED_MS);
    if (this.#settled) this.#writeNumbers();
    this.#settled = true;
  };

  constructor(host: HTMLElement, twin: RobotTwin, from: TableSources = {}) {
    this.#host = host;
    this.#twin = twin;
    this.#from = from;
    // Opening a card takes room; dragging the panel changes it.
    const shrinks = new ResizeObserver(() => {
      this.#names?.fit();
      this.#reveal();
    });
    if (host.parentElement !== null) shrinks.observe(host.parentElement);
    const chosen = () => {
      const row = this.#rows.find(({ label }) => label === selection()?.joint);
      if (row?.element.hidden) setFilter('');
      this.#mark();
      this.#reveal();
    };
    this.#leave = [
      onSelection(chosen),
      onFilter(() => this.#arrange(this.#from.nowMs?.() ?? 0, true)),
      () => shrinks.disconnect(),
      () => this.#sight.disconnect(),
      () => clearTimeout(this.#settle),
    ];
  }

  write(nowMs: number): void {
    const { schema, state, tree } = this.#twin;
    const table = this.#twin.joints();
    if (schema === null || table === null) return;
    const { angle, limbs: grouped, names } = settings();
    const wanted = [schema, say(), grouped, grouped ? tree : null, names];
    if (wanted.some((part, i) => part !== this.#builtFor[i])) {
      this.#builtFor = wanted;
      this.#build(schema, table, grouped ? titledLimbs(schema, tree) : null);
      this.#angle = '';
    }
    if (this.#root === null) return;
    if (this.#names === null) {
      this.#names = new NameColumn(this.#root, this.#rows);
      this.#names.fit();
    }
    const all = angle !== this.#angle;
    if (all) this.#chooseUnits(schema);
    if (state !== null) {
      const { faults, readings } = this.#from;
      const mayBeLost = readings?.anyLost === true;
      const told = faults?.version ?? 0;
      const anyRow = mayBeLost || told !== this.#saidFaults;
      this.#saidFaults = mayBeLost ? Number.NaN : told;
      this.#turn = (this.#turn + 1) % TURNS;
      for (let i = 0; i < this.#rows.length; i += 1) {
        const due = all || this.#seen[i] === 1 || i % TURNS === this.#turn;
        const gone = due || mayBeLost ? this.#writeNumbersOf(i, due) : NOTHING_LOST;
        if (anyRow || table.changes[i] !== this.#said[i]) this.#say(table, i, gone, nowMs);
      }
      this.#settled = false;
      this.#settle ??= setTimeout(this.#settleDown, SETTLED_MS);
      this.#root.dataset.seq = String(state.seq);
    }
    this.#arrange(nowMs);
  }

  /** Writes all numbers of the newest frame. */
  #writeNumbers(): void {
    if (this.#twin.state === null) return;
    this.#rows.forEach((_, i) => {
      this.#writeNumbersOf(i, true);
    });
  }

  /** Called when rows scroll into or out of view. */
  #look(changes: readonly IntersectionObserverEntry[]): void {
    for (const { target, isIntersecting } of changes) {
      const i = this.#rows.findIndex(({ element }) => element === target);
      this.#seen[i] = Number(isIntersecting); // a removed row is not on screen
    }
    this.#writeNumbers();
  }

  dispose(): void {
    for (const off of this.#leave) off();
    this.#host.replaceChildren();
  }

  /** Writes a row's faults and states. */
  #say(table: JointTable, i: number, gone: readonly Lost[], nowMs: number): void {
    const row = table.rows[i]!;
    const fault = this.#from.faults?.of(row.label) ?? null;
    const anew = table.changes[i] !== this.#said[i];
    this.#said[i] = table.changes[i]!;
    this.#rows[i]!.write(row, fault, gone.length === 0 ? '' : oldWords(gone, nowMs), anew);
    this.#ranks.set(i, row.level, fault !== null);
  }

  /** Writes a row's numbers if they are due. Returns those that have no reading now. */
  #writeNumbersOf(i: number, due: boolean): readonly Lost[] {
    const { readings } = this.#from;
    const mayBeLost = readings?.anyLost === true;
    let gone = NOTHING_LOST;
    const columns = this.#columns;
    for (let c = 0; c < columns.length; c += 1) {
      const { name, values, field, display, own } = columns[c]!;
      let value = values[i]!;
      let old = false;
      if (mayBeLost && Number.isNaN(value)) {
        const sinceMs = readings.lostMs(field, i);
        if (sinceMs !== null) {
          old = true;
          value = valueAt(readings.codes, field, i) ?? Number.NaN;
          gone = [...gone, { name, sinceMs }];
        }
      }
      if (due) this.#grid?.set(i * columns.length + c, value, own?.[i] ?? display, old);
    }
    return gone;
  }

  /** Sorts the rows: faults first, then lasting cautions, then the robot's own order, grouped by limb if the viewer wants that.
   *  The DOM is written only when the order or the set of filtered rows changes. */
  #arrange(nowMs: number, filterChanged = false): void {
    const { faultsFirst } = settings();
    const filtered = hasFilter();
    const ranks = this.#shownRanks;
    const moved = new Set<Element>();
    for (let i = 0; i < this.#rows.length; i += 1) {
      const own = this.#ranks.of(i, nowMs);
      const rank = filtered && !matchesFilter(this.#rows[i]!.haystack) ? HIDDEN : faultsFirst ? own : 0;
      if (rank === ranks[i]) continue;
      ranks[i] = rank;
      moved.add(this.#rows[i]!.element);
    }
    if (filterChanged || moved.size > 0) this.#order(moved);
  }

  /** `moved`: the rows whose rank has changed. The others keep their order. */
  #order(moved: Set<Element>): void {
    const ranks = this.#shownRanks;
    const limbs = this.#bodies.map((body) => {
      const { element, rows } = body;
      for (const i of rows) this.#rows[i]!.element.hidden = ranks[i] === HIDDEN;
      const sorted = [...rows].sort((a, b) => ranks[b]! - ranks[a]!);
      placeInOrder(
        element,
        sorted.map((i) => this.#rows[i]!.element),
        moved,
      );
      const rank = Math.max(...sorted.map((i) => ranks[i]!));
      element.hidden = rank === HIDDEN;
      const isFirst = rank === 2;
      if (isFirst !== body.isFirst) moved.add(element);
      body.isFirst = isFirst;
      return body;
    });
    limbs.sort((a, b) => Number(b.isFirst) - Number(a.isFirst));
    if (this.#root !== null)
      placeInOrder(
        this.#root,
        limbs.map(({ element }) => element),
        moved,
      );
    if (this.#nothing !== null) {
      const none = limbs.every(({ element }) => element.hidden);
      this.#nothing.textContent = none ? say().noJointMatches(filterText()) : '';
      this.#nothing.hidden = !none;
    }
    this.#writeNumbers(); // a row that moves up from off screen
  }

  #mark(): void {
    const joint = selection()?.joint ?? null;
    for (const { element, label } of this.#rows) {
      if (label === joint) element.setAttribute('aria-current', 'true');
      else if (element.hasAttribute('aria-current')) element.removeAttribute('aria-current');
    }
  }

  /** Scrolls the selected joint's row into view. */
  #reveal(): void {
    const row = this.#host.querySelector<HTMLElement>('tr[aria-current]');
    row?.scrollIntoView?.({ block: 'nearest' });
  }

  #chooseUnits(schema: Schema): void {
    const { angle } = settings();
    this.#angle = angle;
    this.#grid?.forget();
    for (const column of this.#columns) {
      const name = fieldOfNumber(column.name);
      const field = schema.field(name);
      column.display = displayOf(field?.unit ?? '', angle, field?.scale);
      column.unit.set(column.display.unit);
      const own = this.#rows.map(({ label }) => {
        const unit = schema.mapping.unit(name, label);
        return unit === null ? null : displayOf(unit, angle, field?.scale);
      });
      column.own = own.some((display) => display !== null) ? own : null;
    }
  }

  #build(schema: Schema, table: JointTable, limbs: readonly Limb[] | null): void {
    const text = say();
    const { names } = settings();
    this.#names = null;
    this.#ranks = new Ranks(table.rows.length);
    this.#shownRanks = new Int8Array(table.rows.length);
    this.#said = new Uint32Array(table.rows.length).fill(-1);
    this.#saidFaults = Number.NaN;
    this.#seen = new Uint8Array(table.rows.length).fill(1);
    this.#sight.disconnect();
    if (table.rows.length === 0) {
      this.#host.replaceChildren(createElement('p', 'note', text.noJoints));
      this.#root = null;
      this.#rows = [];
      this.#columns = [];
      this.#bodies = [];
      return;
    }
    const numbers = NUMBERS.filter(({ name }) => table.has(name));
    const states = STATES.filter((name) => table.has(name));
    const root = createElement('table', 'joints');
    root.dataset.testid = 'joint-table';
    root.append(createElement('caption', 'unseen', text.joints));
    const head = createElement('tr', '');
    head.append(headCell(text.joint, 'c-joint', text.jointWhat, 'joint'));
    this.#columns = numbers.map((number) => {
      const { name } = number;
      const cell = headCell(text[name], classOf(number), text[`${name}What`], name);
      head.append(cell);
      return {
        name,
        values: table.numbers[name],
        field: table.column(name),
        unit: new TextCell(cell.appendChild(createUnit())),
        display: displayOf('', 'rad'),
        own: null,
      };
    });
    for (const name of states) head.append(headCell(text[name], 'c-state', text[`${name}What`], name));
    head.append(headCell(table.has('flags') ? text.flags : text.notes, 'c-flags', text.flagsWhat, 'flags'));
    const thead = createElement('thead', '');
    thead.append(head);
    root.append(thead);

    const limbOf = new Map(limbs?.flatMap(({ title, labels }) => labels.map((label) => [label, title])));
    this.#rows = table.rows.map((row) => {
      const unitOf = (name: NumberName) => schema.mapping.unit(fieldOfNumber(name), row.label);
      const name = (names === 'words' && wordsOfName(schema, row.label, languageTag())) || row.label;
      const plain = plainName(schema, row.label, languageTag()) ?? null;
      return new RowView(row, name, plain, limbOf.get(row.label) ?? '', unitOf, numbers, states);
    });
    this.#grid = new NumberGrid(this.#rows.flatMap((row) => row.numbers));
    const placeOf = new Map(this.#rows.map((row, i) => [row.label, i]));
    const all = [{ title: null, labels: [...placeOf.keys()] }];
    this.#bodies = (limbs ?? all).map(({ title, labels }) => {
      const rows = labels.flatMap((label) => placeOf.get(label) ?? []);
      const element = createElement('tbody', '');
      if (title !== null) {
        const name = createElement('th', '', title);
        name.scope = 'rowgroup';
        name.colSpan = head.childElementCount;
        name.append(createElement('span', 'quiet', ` ${rows.length}`));
        const heading = createElement('tr', 'limb');
        heading.append(name);
        element.append(heading);
      }
      element.append(...rows.map((i) => this.#rows[i]!.element));
      return { element, rows, isFirst: false };
    });
    root.append(...this.#bodies.map(({ element }) => element));
    root.addEventListener('click', ({ target }) => {
      const label = (target as HTMLElement).closest<HTMLElement>('tr[data-label]')?.dataset.label;
      if (label !== undefined) selectJoint(label);
    });
    this.#root = root;
    this.#nothing = createElement('p', 'note');
    this.#nothing.hidden = true;
    this.#host.replaceChildren(root, this.#nothing);
    for (const { element } of this.#rows) this.#sight.observe(element);
    this.#mark();
    this.#reveal();
  }
}

/** Puts the last children of an element in order by moving those in `moved`. An element that is moved loses the focus, and is seen
 *  anew by observers and screen readers; so the one that has the focus stays, and the others move around it. */
function placeInOrder(parent: Element, ordered: readonly Element[], moved: ReadonlySet<Element>): void {
  const focus = ordered.findIndex((each) => each.contains(document.activeElement));
  const focused = ordered[focus];
  let next: Element | null = null;
  for (let i = ordered.length - 1; i >= 0; i -= 1) {
    const element = ordered[i]!;
    const isOnItsSide = focused === undefined || isAfter(element, focused) === i > focus;
    if (element !== focused && (moved.has(element) || !isOnItsSide)) parent.insertBefore(element, next);
    next = element;
  }
}

function isAfter(element: Element, other: Element): boolean {
  return (other.compareDocumentPosition(element) & Node.DOCUMENT_POSITION_FOLLOWING) !== 0;
}

function headCell(text: string, className: string, title: string, key: string): HTMLTableCellElement {
  const cell = createElement('th', className);
  cell.append(createTerm(text, `columns.${key}`));
  cell.scope = 'col';
  cell.title = title;
  return cell;
}
