import './sensors.css';
import { useLayoutEffect, useRef } from 'react';
import { type Display, displayOf, formatSpan } from '../../../twin/format.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import type { LastReadings } from '../../../twin/sensors/last_readings.ts';
import { type Reading, type SensorGroup, SensorTable } from '../../../twin/sensors/sensors.ts';
import { BalanceNumbers } from '../../balance/BalanceParts.tsx';
import { createTerm, createUnit } from '../../explain/terms.tsx';
import { createElement, DataAttribute, NumberGrid, setPressed, TextCell } from '../../shell/cells.ts';
import { refreshWith } from '../../shell/refresh.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { settings } from '../../state/settings.ts';
import { isPlotted, onTraces, toggleTrace } from '../../state/viewing.ts';
import { more, onLanguage, say } from '../../text/language.ts';

/** The age is shown for readings lost longer than this. */
const OLD_MS = 1500;

/** The text after a group's name. */
function kindWords(kind: SensorGroup['kind']): string {
  const { ofBase, ofForce, ofOther } = more();
  return { base: ofBase, wrench: ofForce, imu: 'IMU', power: '', other: ofOther }[kind];
}

interface ReadingView {
  readonly reading: Reading;
  /** The same reading taken from the last known values, for when the newest frame has none. */
  readonly last: Reading;
  readonly value: HTMLElement;
  readonly unit: TextCell;
  readonly level: DataAttribute;
  readonly plot: HTMLElement;
  readonly group: GroupView;
}

interface GroupView {
  readonly old: TextCell;
  lostMs: number | null;
}

/** Shows force-torque sensors, IMUs, power and all other readings, in one small table for each site. */
export class SensorView {
  readonly #twin: RobotTwin;
  readonly #host: HTMLElement;
  readonly #last: LastReadings | null;
  #builtFor: readonly unknown[] = [];
  #table: SensorTable | null = null;
  #lastTable: SensorTable | null = null;
  #root: HTMLElement | null = null;
  #groups: GroupView[] = [];
  #views: ReadingView[] = [];
  /** The value that each view shows. */
  #values = new NumberGrid([]);
  readonly #displays = new Map<string, Display>();
  #angle = '';

  constructor(host: HTMLElement, twin: RobotTwin, last: LastReadings | null = null) {
    this.#host = host;
    this.#twin = twin;
    this.#last = last;
  }

  write(nowMs: number): void {
    const { schema, state } = this.#twin;
    if (schema === null) return;
    if (schema !== this.#builtFor[0] || more() !== this.#builtFor[1]) this.#build();
    if (this.#table === null || this.#root === null || state === null) return;
    this.#table.read(state.codes, this.#twin.limits ?? undefined);
    const lost = this.#last?.anyLost === true ? this.#last : null;
    if (lost !== null) this.#lastTable?.read(lost.codes);
    for (const group of this.#groups) group.lostMs = null;
    for (const [i, { reading, last, unit, level, plot, group }] of this.#views.entries()) {
      const display = this.#displayOf(reading);
      const old = reading.value === null && lost !== null && last.value !== null;
      this.#values.set(i, old ? last.value : reading.value, display, old);
      if (old)
        group.lostMs = Math.min(
          group.lostMs ?? Number.POSITIVE_INFINITY,
          this.#lostMs(reading, lost) ?? nowMs,
        );
      unit.set(display.unit);
      level.set(reading.level);
      setPressed(plot, isPlotted(reading));
    }
    for (const { old, lostMs } of this.#groups) {
      const age = lostMs === null ? 0 : nowMs - lostMs;
      old.set(age < OLD_MS ? '' : more().oldBy(formatSpan(Math.floor(age / 1000) * 1000)));
    }
    this.#root.dataset.seq = String(state.seq);
  }

  dispose(): void {
    this.#host.replaceChildren();
  }

  /** When a reading was lost; for an angle, when any part of its quaternion was lost. */
  #lostMs({ field: name, label }: Reading, last: LastReadings): number | null {
    const field = this.#twin.schema?.field(name) ?? null;
    const site = label.slice(0, label.lastIndexOf('.') + 1);
    const labels =
      name === 'quat' || name === 'baseq' ? ['w', 'x', 'y', 'z'].map((part) => site + part) : [label];
    const lost = labels.flatMap((one) => last.lostMs(field, field?.labels.indexOf(one) ?? -1) ?? []);
    return lost.length === 0 ? null : Math.min(...lost);
  }

  #displayOf({ unit, scale }: Reading): Display {
    const { angle } = settings();
    if (angle !== this.#angle) {
      this.#displays.clear();
      this.#values.forget();
    }
    this.#angle = angle;
    const key = `${unit} ${scale}`;
    const known = this.#displays.get(key) ?? displayOf(unit, angle, scale);
    this.#displays.set(key, known);
    return known;
  }

  #build(): void {
    const { schema } = this.#twin;
    if (schema === null) return;
    const text = more();
    this.#builtFor = [schema, text];
    const table = new SensorTable(schema, text);
    this.#table = table;
    this.#lastTable = new SensorTable(schema);
    this.#views = [];
    this.#groups = [];
    if (table.groups.length === 0) {
      this.#host.replaceChildren(createElement('p', 'note', text.noSensors));
      this.#root = null;
      return;
    }
    const root = createElement('div', 'sensors');
    root.dataset.testid = 'sensor-table';
    table.groups.forEach((group, i) => {
      root.append(this.#group(group, this.#lastTable!.groups[i]!));
    });
    this.#values = new NumberGrid(this.#views.map(({ value }) => value));
    root.addEventListener('click', ({ target }) => {
      const row = (target as HTMLElement).closest('tr');
      const { field, label } = row?.querySelector<HTMLElement>('[data-field]')?.dataset ?? {};
      if (field !== undefined && label !== undefined) toggleTrace({ field, label });
    });
    this.#root = root;
    this.#host.replaceChildren(root);
  }

  #group(group: SensorGroup, last: SensorGroup): HTMLTableElement {
    const table = createElement('table', 'sensor');
    const caption = createElement('caption', '', group.title);
    caption.append(createTerm(kindWords(group.kind) || group.title, `sensors.${group.kind}`, 'kind'));
    const old = caption.appendChild(createElement('span', 'old'));
    table.append(caption);
    const view: GroupView = { old: new TextCell(old), lostMs: null };
    this.#groups.push(view);
    const body = createElement('tbody', '');
    group.readings.forEach((reading, i) => {
      const row = createElement('tr', '');
      const name = createElement('th', '');
      name.scope = 'row';
      const plot = createElement('button', '', reading.name);
      plot.type = 'button';
      plot.title = more().toPlots;
      name.append(plot);
      const value = createElement('td', 'c-num');
      value.dataset.field = reading.field;
      value.dataset.label = reading.label;
      value.draggable = true;
      const unitRoom = createElement('td', 'unit');
      const unit = unitRoom.appendChild(createUnit());
      row.append(name, value, unitRoom);
      body.append(row);
      this.#views.push({
        reading,
        last: last.readings[i]!,
        value,
        unit: new TextCell(unit),
        level: new DataAttribute(row, 'level'),
        plot,
        group: view,
      });
    });
    table.append(body);
    return table;
  }
}

/** The element for the sensors, whose numbers are written directly to the DOM, without React, and below it the values that the
 *  page computes. */
export function Sensors({ link }: { link: RobotLink }) {
  const host = useRef<HTMLDivElement>(null);
  useLayoutEffect(() => {
    if (host.current === null) return;
    host.current.replaceChildren(createElement('p', 'note late', say().noNumbersYet));
    const view = new SensorView(host.current, link.twin, link.minute.readings);
    const write = () => view.write(link.nowMs());
    if (link.twin.state !== null) write(); // with the state word above, because entering the past changes all numbers at once
    const stop = refreshWith(link.twin, write, [onTraces, onLanguage]);
    return () => {
      stop();
      view.dispose();
    };
  }, [link]);
  return (
    <>
      <div className="numbers" ref={host} />
      <BalanceNumbers link={link} />
    </>
  );
}
