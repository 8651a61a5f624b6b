import { nowMs } from '../../stream/clock.ts';
import type { Fault } from '../../twin/fault_book.ts';
import { type Display, displayOf } from '../../twin/format.ts';
import { type JointRow, JointTable } from '../../twin/joints.ts';
import type { LastReadings } from '../../twin/last_readings.ts';
import type { Limb } from '../../twin/limbs.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { valueAt } from '../../twin/values.ts';
import { say } from '../language.ts';
import type { titledLimbs } from '../limb_titles.ts';
import { onSelection, selection, selectJoint } from '../selection.ts';
import { settings } from '../settings.ts';
import { make, TextCell } from './cells.ts';
import { anyFilter, filterText, onFilter, passes, setFilter } from './filter.ts';
import { type Lost, NUMBERS, type NumberName, oldWords, RowView, STATES } from './joint_row.ts';
import { NumberGrid } from './number_grid.ts';
import { carryValues } from './value_drag.ts';

/** What the table asks of the page around it. */
export interface TableSources {
  /** A joint's fault that nobody has acknowledged yet. */
  readonly openFault?: (label: string) => Fault | null;
  readonly readings?: LastReadings;
  /** Puts the joints together limb by limb; null until its code is here. */
  limbs?: typeof titledLimbs | null;
}

/** A column of numbers. */
interface Column {
  readonly name: NumberName;
  /** Where it comes from; null of what is computed: ref − pos. */
  readonly field: ReturnType<JointTable['column']>;
  readonly unit: TextCell;
  display: Display;
  /** Of single rows, where a channel has a unit of its own; null where there is none such. */
  own: readonly (Display | null)[] | null;
}

/** Of a row that the filter does not let through. */
const HIDDEN = -1;
/** Rows that nobody sees are written in turns, one in so many at a time: within a second each. */
const TURNS = 10;
/** After the last frame all that was left is written. */
const SETTLED_MS = 300;
const NOTHING_LOST: readonly Lost[] = [];

/** The joint table, written straight into the page: React never sees a frame. */
export class JointView {
  readonly #twin: RobotTwin;
  readonly #host: HTMLElement;
  readonly #from: TableSources;
  readonly #leave: readonly (() => void)[];
  #table: JointTable | null = null;
  #root: HTMLTableElement | null = null;
  #rows: readonly RowView[] = [];
  #grid: NumberGrid | null = null;
  #columns: readonly Column[] = [];
  #bodies: { element: HTMLElement; rows: readonly number[] }[] = [];
  #nothing: HTMLElement | null = null;
  #builtFor: readonly unknown[] = [];
  #angle = '';
  /** Of each row: 2, 1, 0 as `RowView.rank` has it, or HIDDEN; what the page shows. */
  #ranks = new Int8Array(0);
  /** Which rows are on the screen: 1, 0. Writing a number costs more than all else that is done for it. */
  #seen = new Uint8Array(0);
  readonly #sight: IntersectionObserver | null;
  #turn = 0;
  /** One timer for many frames: to set one costs more than to write a row. */
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
    const shrinks = new ResizeObserver(() => this.#reveal()); // a card that opens takes room
    if (host.parentElement !== null) shrinks.observe(host.parentElement);
    const chosen = () => {
      const row = this.#rows.find(({ label }) => label === selection()?.joint);
      if (row?.element.hidden) setFilter('');
      this.#mark();
      this.#reveal();
    };
    this.#sight =
      typeof IntersectionObserver === 'undefined'
        ? null
        : new IntersectionObserver((changes) => this.#look(changes));
    this.#leave = [
      onSelection(chosen),
      onFilter(() => this.#arrange(nowMs(), true)),
      () => shrinks.disconnect(),
      () => this.#sight?.disconnect(),
      () => clearTimeout(this.#settle),
    ];
  }

  write(nowMs: number): void {
    const { schema, state, tree } = this.#twin;
    if (schema === null) return;
    const { angle, limbs: grouped } = settings();
    const limbsOf = grouped ? (this.#from.limbs ?? null) : null;
    const wanted = [schema, say(), limbsOf, limbsOf === null ? null : tree];
    if (wanted.some((part, i) => part !== this.#builtFor[i])) {
      this.#builtFor = wanted;
      this.#build(limbsOf?.(schema, tree) ?? null);
      this.#angle = '';
    }
    if (this.#table === null || this.#root === null) return;
    const all = angle !== this.#angle;
    if (all) this.#chooseUnits();
    if (state !== null) {
      const rows = this.#table.read(state.codes, this.#twin.limits ?? undefined);
      this.#turn = (this.#turn + 1) % TURNS;
      for (let i = 0; i < rows.length; i += 1) {
        const due = all || this.#seen[i] === 1 || i % TURNS === this.#turn;
        this.#writeRow(rows[i]!, i, nowMs, due);
      }
      this.#settled = false;
      this.#settle ??= setTimeout(this.#settleDown, SETTLED_MS);
      this.#root.dataset.seq = String(state.seq);
    }
    this.#arrange(nowMs);
  }

  /** All numbers of the newest frame that is shown. */
  #writeNumbers(): void {
    if (this.#twin.state === null) return;
    this.#table?.rows.forEach((row, i) => {
      this.#writeNumbersOf(row, i, true);
    });
  }

  /** Rows have come into sight, or gone out of it. */
  #look(changes: readonly IntersectionObserverEntry[]): void {
    for (const { target, isIntersecting } of changes) {
      const i = this.#rows.findIndex(({ element }) => element === target);
      this.#seen[i] = Number(isIntersecting); // of a row that is gone: nowhere
    }
    if (changes.some(({ isIntersecting }) => isIntersecting)) this.#writeNumbers();
  }

  dispose(): void {
    for (const off of this.#leave) off();
    this.#host.replaceChildren();
  }

  /** What is wrong with a row is said at once; its numbers when they are due. */
  #writeRow(row: JointRow, i: number, nowMs: number, due: boolean): void {
    const gone = this.#writeNumbersOf(row, i, due);
    const { openFault } = this.#from;
    const old = gone.length === 0 ? '' : oldWords(gone, nowMs);
    this.#rows[i]?.write(row, openFault?.(row.label) ?? null, old, nowMs);
  }

  /** Returns what is not read any more. */
  #writeNumbersOf(row: JointRow, i: number, due: boolean): readonly Lost[] {
    const { readings } = this.#from;
    const mayBeLost = readings?.anyLost === true;
    let gone = NOTHING_LOST;
    if (!(due || mayBeLost)) return gone;
    const columns = this.#columns;
    for (let c = 0; c < columns.length; c += 1) {
      const { name, field, display, own } = columns[c]!;
      let value = row[name];
      let sinceMs: number | null = null;
      if (mayBeLost && field !== null && value === null) {
        sinceMs = readings.lostMs(field, i);
        if (sinceMs !== null) {
          value = valueAt(readings.codes, field, i);
          gone = [...gone, { name, sinceMs }];
        }
      }
      if (due) this.#grid?.set(i * columns.length + c, value, own?.[i] ?? display, sinceMs !== null);
    }
    return gone;
  }

  /** Faults first, then what has been doubtful for a while, else the robot's own order, limb by limb where that is
   *  wanted. The page is touched only when the order, or what the filter lets through, changes. */
  #arrange(nowMs: number, filterChanged = false): void {
    const { faultsFirst } = settings();
    const filtered = anyFilter();
    const ranks = this.#ranks;
    let changed = filterChanged;
    for (let i = 0; i < this.#rows.length; i += 1) {
      const row = this.#rows[i]!;
      const rank = filtered && !passes(row.haystack) ? HIDDEN : faultsFirst ? row.rank(nowMs) : 0;
      if (rank === ranks[i]) continue;
      ranks[i] = rank;
      changed = true;
    }
    if (changed) this.#order();
  }

  #order(): void {
    const ranks = this.#ranks;
    const limbs = this.#bodies.map(({ element, rows }) => {
      for (const i of rows) this.#rows[i]!.element.hidden = ranks[i] === HIDDEN;
      const sorted = [...rows].sort((a, b) => ranks[b]! - ranks[a]!);
      element.append(...sorted.map((i) => this.#rows[i]!.element));
      const rank = Math.max(...sorted.map((i) => ranks[i]!));
      element.hidden = rank === HIDDEN;
      return { element, rank };
    });
    limbs.sort((a, b) => Number(b.rank === 2) - Number(a.rank === 2));
    if (limbs.length > 1) this.#root?.append(...limbs.map(({ element }) => element));
    if (this.#nothing !== null) {
      const none = limbs.every(({ rank }) => rank === HIDDEN);
      this.#nothing.textContent = none ? say().noJointMatches(filterText()) : '';
      this.#nothing.hidden = !none;
    }
    this.#writeNumbers(); // what comes up from where nobody saw it
  }

  #mark(): void {
    const joint = selection()?.joint ?? null;
    for (const { element, label } of this.#rows) {
      if (label === joint) element.setAttribute('aria-current', 'true');
      else if (element.hasAttribute('aria-current')) element.removeAttribute('aria-current');
    }
  }

  /** Brings the chosen joint's row where it can be seen. */
  #reveal(): void {
    const row = this.#host.querySelector<HTMLElement>('tr[aria-current]');
    row?.scrollIntoView?.({ block: 'nearest' });
  }

  #chooseUnits(): void {
    const { schema } = this.#twin;
    if (schema === null) return;
    const { angle } = settings();
    this.#angle = angle;
    this.#grid?.forget();
    for (const column of this.#columns) {
      const name = column.name === 'error' ? 'pos' : column.name;
      const field = schema.field(name);
      column.display = displayOf(field?.unit ?? '', angle, field?.scale);
      column.unit.set(column.display.unit);
      const own = this.#rows.map(({ label }) => {
        const unit = schema.mapping.unit(name, label);
        return unit === null ? null : displayOf(unit, angle);
      });
      column.own = own.some((display) => display !== null) ? own : null;
    }
  }

  #build(limbs: readonly Limb[] | null): void {
    const { schema } = this.#twin;
    if (schema === null) return;
    const text = say();
    const table = new JointTable(schema);
    this.#table = table;
    this.#ranks = new Int8Array(table.rows.length);
    this.#seen = new Uint8Array(table.rows.length).fill(1);
    this.#sight?.disconnect();
    if (table.rows.length === 0) {
      this.#host.replaceChildren(make('p', 'note', text.noJoints));
      this.#root = null;
      this.#rows = [];
      this.#columns = [];
      this.#bodies = [];
      return;
    }
    const numbers = NUMBERS.filter((name) => table.has(name));
    const states = STATES.filter((name) => table.has(name));
    const root = make('table', 'joints');
    root.dataset.testid = 'joint-table';
    root.append(make('caption', 'unseen', text.joints));
    const head = make('tr', '');
    head.append(headCell(text.joint, 'c-joint', text.jointWhat));
    this.#columns = numbers.map((name) => {
      const cell = headCell(text[name], `c-num c-${name}`, text[`${name}What`]);
      head.append(cell);
      return {
        name,
        field: name === 'error' ? null : table.column(name),
        unit: new TextCell(cell.appendChild(make('span', 'unit'))),
        display: displayOf('', 'rad'),
        own: null,
      };
    });
    for (const name of states) head.append(headCell(text[name], 'c-state', text[`${name}What`]));
    head.append(headCell(table.has('flags') ? text.flags : text.notes, 'c-flags', text.flagsWhat));
    const thead = make('thead', '');
    thead.append(head);
    root.append(thead);

    const limbOf = new Map(limbs?.flatMap(({ title, labels }) => labels.map((label) => [label, title])));
    this.#rows = table.rows.map((row) => {
      const unit = schema.mapping.unit('pos', row.label);
      return new RowView(row, limbOf.get(row.label) ?? '', unit, numbers, states);
    });
    this.#grid = new NumberGrid(this.#rows.flatMap((row) => row.numbers));
    const placeOf = new Map(this.#rows.map((row, i) => [row.label, i]));
    const all = [{ title: null, labels: [...placeOf.keys()] }];
    this.#bodies = (limbs ?? all).map(({ title, labels }) => {
      const rows = labels.flatMap((label) => placeOf.get(label) ?? []);
      const element = make('tbody', '');
      if (title !== null) {
        const name = make('th', '', title);
        name.scope = 'rowgroup';
        name.colSpan = head.childElementCount;
        name.append(make('span', 'quiet', ` ${rows.length}`));
        const heading = make('tr', 'limb');
        heading.append(name);
        element.append(heading);
      }
      element.append(...rows.map((i) => this.#rows[i]!.element));
      return { element, rows };
    });
    root.append(...this.#bodies.map(({ element }) => element));
    root.addEventListener('click', ({ target }) => {
      const label = (target as HTMLElement).closest<HTMLElement>('tr[data-label]')?.dataset.label;
      if (label !== undefined) selectJoint(label);
    });
    carryValues(root);
    this.#root = root;
    this.#nothing = make('p', 'note');
    this.#nothing.hidden = true;
    this.#host.replaceChildren(root, this.#nothing);
    for (const { element } of this.#rows) this.#sight?.observe(element);
    this.#mark();
    this.#reveal();
  }
}

function headCell(text: string, className: string, title: string): HTMLTableCellElement {
  const cell = make('th', className, text);
  cell.scope = 'col';
  cell.title = title;
  return cell;
}
