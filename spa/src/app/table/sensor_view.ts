import { displayOf, formatNumber } from '../../twin/format.ts';
import type { RobotTwin } from '../../twin/robot.ts';
import { type Reading, type SensorGroup, SensorTable } from '../../twin/sensors.ts';
import { settings } from '../settings.ts';
import { DataMark, make, TextCell } from './cells.ts';

const KINDS: Readonly<Record<SensorGroup['kind'], string>> = {
  wrench: 'force',
  imu: 'IMU',
  power: 'power',
  other: 'other',
};

interface ReadingView {
  reading: Reading;
  value: TextCell;
  unit: TextCell;
  level: DataMark;
}

/** Force-torque sensors, IMUs, power and whatever else a robot reports, one small table for each place. */
export class SensorView {
  readonly #twin: RobotTwin;
  readonly #host: HTMLElement;
  #schemaId: number | null = null;
  #table: SensorTable | null = null;
  #root: HTMLElement | null = null;
  #views: ReadingView[] = [];

  constructor(host: HTMLElement, twin: RobotTwin) {
    this.#host = host;
    this.#twin = twin;
  }

  write(): void {
    const { schema, state } = this.#twin;
    if (schema === null) return;
    if (schema.id !== this.#schemaId) this.#build();
    if (this.#table === null || this.#root === null || state === null) return;
    this.#table.read(state.codes);
    const { angle } = settings();
    for (const { reading, value, unit, level } of this.#views) {
      const display = displayOf(reading.unit, angle, reading.scale);
      value.set(formatNumber(reading.value, display));
      unit.set(display.unit);
      level.set(reading.level);
    }
    this.#root.dataset.seq = String(state.seq);
  }

  dispose(): void {
    this.#host.replaceChildren();
  }

  #build(): void {
    const { schema } = this.#twin;
    if (schema === null) return;
    this.#schemaId = schema.id;
    const table = new SensorTable(schema);
    this.#table = table;
    this.#views = [];
    if (table.groups.length === 0) {
      this.#host.replaceChildren(make('p', 'note', 'This robot reports no sensors.'));
      this.#root = null;
      return;
    }
    const root = make('div', 'sensors');
    root.dataset.testid = 'sensor-table';
    for (const group of table.groups) root.append(this.#group(group));
    this.#root = root;
    this.#host.replaceChildren(root);
  }

  #group(group: SensorGroup): HTMLTableElement {
    const table = make('table', 'sensor');
    const caption = make('caption', '', group.title);
    caption.append(make('span', 'kind', group.kind === 'power' ? '' : KINDS[group.kind]));
    table.append(caption);
    const body = make('tbody', '');
    for (const reading of group.readings) {
      const row = make('tr', '');
      const name = make('th', '', reading.name);
      name.scope = 'row';
      const value = make('td', 'c-num');
      value.dataset.field = reading.field;
      value.dataset.label = reading.label;
      const unit = make('td', 'unit');
      row.append(name, value, unit);
      body.append(row);
      this.#views.push({
        reading,
        value: new TextCell(value),
        unit: new TextCell(unit),
        level: new DataMark(row, 'level'),
      });
    }
    table.append(body);
    return table;
  }
}
