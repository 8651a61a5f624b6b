import { displayOf, formatNumber } from '../../twin/format.ts';
import { type JointRow, JointTable } from '../../twin/joints.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { settings } from '../settings.ts';
import { DataMark, make, TextCell } from './cells.ts';

/** A row that was faulty stays on top this long after: rows that hop up and down can't be read. */
const STAYS_ON_TOP_MS = 5000;

const NUMBERS = ['ref', 'pos', 'error', 'cur', 'temp'] as const;
type NumberName = (typeof NUMBERS)[number];
const STATES = ['homed', 'enabled'] as const;

const HEADS: Readonly<Record<NumberName, { text: string; title: string }>> = {
  ref: { text: 'ref', title: 'Where the joint was told to be' },
  pos: { text: 'pos', title: 'Where the joint is' },
  error: { text: 'error', title: 'Reference minus position' },
  cur: { text: 'cur', title: 'Motor current' },
  temp: { text: 'temp', title: 'Temperature' },
};

/** The joint table, written straight into the page: React never sees a frame. */
export class JointView {
  readonly #twin: RobotTwin;
  readonly #host: HTMLElement;
  #schemaId: number | null = null;
  #table: JointTable | null = null;
  #root: HTMLTableElement | null = null;
  #rows: RowView[] = [];
  #body: HTMLElement | null = null;
  #units: Partial<Record<NumberName, TextCell>> = {};
  #order = '';

  constructor(host: HTMLElement, twin: RobotTwin) {
    this.#host = host;
    this.#twin = twin;
  }

  write(nowMs: number): void {
    const { schema, state } = this.#twin;
    if (schema === null) return;
    if (schema.id !== this.#schemaId) this.#build();
    const table = this.#table;
    if (table === null || this.#root === null) return;
    const unitOf = (name: NumberName) => {
      const field = schema.field(name === 'error' ? 'pos' : name);
      return displayOf(field?.unit ?? '', settings().angle, field?.scale);
    };
    const displays = {
      ref: unitOf('ref'),
      pos: unitOf('pos'),
      error: unitOf('error'),
      cur: unitOf('cur'),
      temp: unitOf('temp'),
    };
    for (const name of NUMBERS) this.#units[name]?.set(displays[name].unit);
    if (state === null) return;
    const rows = table.read(state.codes);
    rows.forEach((row, i) => {
      const view = this.#rows[i];
      if (view === undefined) return;
      for (const name of NUMBERS) view.numbers[name]?.set(formatNumber(row[name], displays[name]));
      for (const name of STATES) view.states[name]?.set(stateText(row[name]));
      view.flags?.set(row.flags.map((flag) => flag.words).join(', '));
      view.level.set(row.level);
      view.error?.set(row.apart ? 'caution' : 'ok');
      view.cur?.set(row.curLevel);
      view.temp?.set(row.tempLevel);
      if (row.level === 'fault') view.faultMs = nowMs;
    });
    this.#sort(nowMs);
    this.#root.dataset.seq = String(state.seq);
  }

  dispose(): void {
    this.#host.replaceChildren();
  }

  /** Faults first, otherwise in the robot's own order. The page is touched only when the order changes. */
  #sort(nowMs: number): void {
    const first = settings().faultsFirst;
    const onTop = (view: RowView) => first && nowMs - view.faultMs < STAYS_ON_TOP_MS;
    const order = this.#rows.map((view) => (onTop(view) ? '1' : '0')).join('');
    if (order === this.#order) return;
    this.#order = order;
    const sorted = [...this.#rows.filter(onTop), ...this.#rows.filter((view) => !onTop(view))];
    this.#body?.append(...sorted.map((view) => view.element));
  }

  #build(): void {
    const { schema } = this.#twin;
    if (schema === null) return;
    this.#schemaId = schema.id;
    this.#order = '';
    this.#units = {};
    const table = new JointTable(schema);
    this.#table = table;
    if (table.rows.length === 0) {
      this.#host.replaceChildren(make('p', 'note', 'This robot reports no joints.'));
      this.#root = null;
      return;
    }
    const numbers = NUMBERS.filter((name) => table.has(name));
    const states = STATES.filter((name) => table.has(name));
    const withFlags = table.has('flags');

    const root = make('table', 'joints');
    root.dataset.testid = 'joint-table';
    root.append(make('caption', 'unseen', 'Joints'));
    const head = make('tr', '');
    head.append(headCell('Joint', 'c-joint', 'As the robot names it'));
    for (const name of numbers) {
      const cell = headCell(HEADS[name].text, `c-num c-${name}`, HEADS[name].title);
      this.#units[name] = new TextCell(cell.appendChild(make('span', 'unit')));
      head.append(cell);
    }
    for (const name of states) {
      head.append(
        headCell(name === 'homed' ? 'home' : 'on', 'c-state', name === 'homed' ? 'Homed' : 'Enabled'),
      );
    }
    if (withFlags) head.append(headCell('flags', 'c-flags', 'What the joint reports'));
    const thead = make('thead', '');
    thead.append(head);
    const body = make('tbody', '');
    this.#rows = table.rows.map((row) => new RowView(row, numbers, states, withFlags));
    body.append(...this.#rows.map((view) => view.element));
    root.append(thead, body);
    this.#body = body;
    this.#root = root;
    this.#host.replaceChildren(root);
  }
}

class RowView {
  readonly element: HTMLTableRowElement;
  readonly numbers: Partial<Record<NumberName, TextCell>> = {};
  readonly states: Partial<Record<'homed' | 'enabled', TextCell>> = {};
  readonly flags: TextCell | null;
  readonly level: DataMark;
  readonly error: DataMark | null;
  readonly cur: DataMark | null;
  readonly temp: DataMark | null;
  faultMs = Number.NEGATIVE_INFINITY;

  constructor(
    row: JointRow,
    numbers: readonly NumberName[],
    states: readonly ('homed' | 'enabled')[],
    withFlags: boolean,
  ) {
    const element = make('tr', '');
    element.dataset.label = row.label;
    const name = make('th', 'c-joint', row.label);
    name.scope = 'row';
    if (row.plain !== null) name.title = row.plain;
    element.append(name);
    const cell = (field: string, className: string) => {
      const td = make('td', className);
      td.dataset.field = field;
      td.dataset.label = row.label;
      element.append(td);
      return td;
    };
    for (const field of numbers) this.numbers[field] = new TextCell(cell(field, `c-num c-${field}`));
    for (const field of states) this.states[field] = new TextCell(cell(field, 'c-state'));
    this.flags = withFlags ? new TextCell(cell('flags', 'c-flags')) : null;
    this.element = element;
    this.level = new DataMark(element, 'level');
    const mark = (field: NumberName) => {
      const of = this.numbers[field];
      return of === undefined ? null : new DataMark(of.element, 'level');
    };
    this.error = mark('error');
    this.cur = mark('cur');
    this.temp = mark('temp');
  }
}

function headCell(text: string, className: string, title: string): HTMLTableCellElement {
  const cell = make('th', className, text);
  cell.scope = 'col';
  cell.title = title;
  return cell;
}

function stateText(state: boolean | null): string {
  if (state === null) return '—';
  return state ? '✓' : 'no';
}
