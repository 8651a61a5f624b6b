import type { PastState } from '../../../past/past_types.ts';
import { type Display, displayOf, formatNumber, formatSpan } from '../../../twin/format.ts';
import { fieldOfNumber, NUMBERS, type NumberName, numberOf } from '../../../twin/joints.ts';
import { rangeWords } from '../../../twin/limits.ts';
import { HISTORY_S, type History, type TraceHistory } from '../../../twin/plots/history.ts';
import { strip } from '../../../twin/plots/sparkline.ts';
import type { RobotTwin } from '../../../twin/robot.ts';
import type { LastReadings } from '../../../twin/sensors/last_readings.ts';
import { valueAt } from '../../../twin/values.ts';
import { createUnit } from '../../explain/terms.tsx';
import { createElement, NumberGrid, setPressed, TextCell } from '../../shell/cells.ts';
import type { RobotLink } from '../../state/robot_link.ts';
import { settings } from '../../state/settings.ts';
import { isPlotted, toggleTrace } from '../../state/viewing.ts';
import { more } from '../../text/language.ts';

const STRIP = { width: 300, height: 56 };
/** In the past, a strip extends as far ahead of the shown moment as behind it, s. */
const HALF_S = HISTORY_S / 2;

interface Line {
  field: NumberName;
  display: Display;
  unit: TextCell;
  limit: TextCell;
  plot: HTMLElement;
}

interface StripView {
  fields: readonly string[];
  leastRange: number;
  paths: SVGPathElement[];
  /** The data after the shown moment; none in the present. */
  later: SVGPathElement[];
  low: TextCell;
  high: TextCell;
}

/** The robot and its recorded history. */
export type CardLink = Pick<RobotLink, 'twin' | 'minute' | 'coming'>;

/** Shows one joint: its numbers, their limits, and its last minute; in the past, the minute around the shown moment. Written
 *  directly to the DOM, like the table. */
export class JointCardView {
  readonly #host: HTMLElement;
  readonly #twin: RobotTwin;
  readonly #history: History;
  readonly #readings: LastReadings;
  readonly #coming: CardLink['coming'];
  readonly #label: string;
  #builtFor: readonly unknown[] = [];
  #lines: Line[] = [];
  /** The value of each line. */
  #values = new NumberGrid([]);
  #angle = '';
  #strips: StripView[] = [];

  constructor(host: HTMLElement, { twin, minute, coming }: CardLink, label: string) {
    this.#host = host;
    this.#twin = twin;
    this.#history = minute.history;
    this.#readings = minute.readings;
    this.#coming = coming;
    this.#label = label;
  }

  write(nowMs: number): void {
    const { schema, state } = this.#twin;
    if (schema === null) return;
    if (schema !== this.#builtFor[0] || more() !== this.#builtFor[1]) this.#build();
    if (state === null) return;
    const { angle } = settings();
    if (angle !== this.#angle) this.#values.forget();
    for (const [i, line] of this.#lines.entries()) {
      const { field, unit, limit, plot } = line;
      if (angle !== this.#angle) line.display = this.#displayOf(field);
      const lost = this.#lost(field);
      this.#values.set(i, lost?.value ?? this.#value(field), line.display, lost !== null);
      unit.set(line.display.unit);
      const words = [this.#limitWords(line)];
      if (lost !== null) words.unshift(more().lastRead(formatSpan(nowMs - lost.sinceMs)));
      limit.set(words.filter(Boolean).join(' · '));
      setPressed(plot, isPlotted({ field, label: this.#label }));
    }
    this.#angle = angle;
    const coming = this.#coming?.() ?? [];
    for (const view of this.#strips) this.#draw(view, coming, nowMs);
  }

  dispose(): void {
    this.#host.replaceChildren();
  }

  #value(field: Line['field']): number | null {
    const read = (name: string) => this.#twin.value(name, this.#label) ?? null;
    const computed = numberOf(field)?.computed;
    if (computed === undefined) return read(field);
    const [of, minus] = [read(computed.of), read(computed.minus)];
    return of === null || minus === null ? null : of - minus;
  }

  /** The last reading, if there is none now. */
  #lost(name: Line['field']): { value: number | null; sinceMs: number } | null {
    if (!this.#readings.anyLost) return null;
    const field = this.#twin.schema?.field(name) ?? null;
    const index = field?.labels.indexOf(this.#label) ?? -1;
    const sinceMs = this.#readings.lostMs(field, index);
    return sinceMs === null ? null : { value: valueAt(this.#readings.codes, field, index), sinceMs };
  }

  #displayOf(field: string): Display {
    const { schema } = this.#twin;
    const name = fieldOfNumber(field);
    const of = schema?.field(name);
    const unit = schema?.mapping.unit(name, this.#label) ?? of?.unit ?? '';
    return displayOf(unit, settings().angle, of?.scale);
  }

  #limitWords({ field, display }: Line): string {
    const shown = (value: number) => `${formatNumber(value, display).trim()} ${display.unit}`.trim();
    if (numberOf(field)?.judged === 'tolerance') {
      const tolerance = this.#twin.schema?.mapping.tolerance(this.#label) ?? null;
      return tolerance === null ? '' : more().tolerated(shown(tolerance));
    }
    const threshold = this.#twin.limits?.threshold(field, this.#label) ?? null;
    return threshold === null ? '' : more().limitIs(rangeWords(threshold, shown, more()));
  }

  #draw(view: StripView, coming: readonly PastState[], nowMs: number): void {
    const { fields, leastRange, paths, later, low, high } = view;
    const laterS = later.length > 0 ? HALF_S : 0;
    const before = fields.map((field) =>
      since(this.#history.trace(field, this.#label, nowMs), laterS - HISTORY_S),
    );
    const after = later.map((_, i) => this.#traceOf(fields[i]!, coming, nowMs));
    const display = this.#displayOf(fields[0] ?? 'pos');
    const least = display.unit === 'm' ? leastRange / 10 : leastRange;
    const found = strip([...before, ...after], STRIP.width, STRIP.height, HISTORY_S, least, laterS);
    [...paths, ...later].forEach((path, i) => {
      path.setAttribute('d', found?.paths[i] ?? '');
    });
    low.set(found === null ? '' : formatNumber(found.low, display));
    high.set(found === null ? '' : formatNumber(found.high, display));
  }

  /** A field's values in the half minute ahead. */
  #traceOf(name: string, coming: readonly PastState[], nowMs: number): TraceHistory {
    const { schema } = this.#twin;
    const field = schema?.field(name) ?? null;
    const index = field?.labels.indexOf(this.#label) ?? -1;
    const shown = coming.filter(
      ({ schemaId, atMs }) => schemaId === schema?.id && atMs > nowMs && atMs <= nowMs + HALF_S * 1000,
    );
    return {
      agoS: shown.map(({ atMs }) => (atMs - nowMs) / 1000),
      values: shown.map(({ codes }) => valueAt(codes, field, index)),
    };
  }

  #build(): void {
    const { schema } = this.#twin;
    if (schema === null) return;
    const text = more();
    this.#builtFor = [schema, text];
    const has = (field: string) => schema.field(field)?.labels.includes(this.#label) ?? false;
    if (!has('pos') && !has('ref')) {
      this.#host.replaceChildren(createElement('p', 'note', text.noSuchJoint));
      this.#lines = [];
      this.#strips = [];
      return;
    }
    const shown = NUMBERS.filter(({ name, ...rest }) => {
      const { of = name, minus = name } = 'computed' in rest ? rest.computed : {};
      return has(of) && has(minus);
    }).sort((a, b) => a.place - b.place);
    const list = createElement('dl', 'card-values');
    const values: HTMLElement[] = [];
    this.#lines = shown.map(({ name: field }) => {
      const row = createElement('div', '');
      const term = createElement('dt', '', text[`${field}Name`]);
      term.append(createElement('small', 'quiet', text[`${field}Means`]));
      const value = createElement('dd', 'c-num');
      value.dataset.field = field;
      values.push(value);
      const unitRoom = createElement('dd', 'unit');
      const unit = unitRoom.appendChild(createUnit());
      const limit = createElement('dd', 'card-limit');
      const plot = createElement('button', 'text-button', text.plotIt);
      plot.type = 'button';
      plot.dataset.testid = `plot-${field}`;
      plot.addEventListener('click', () => toggleTrace({ field, label: this.#label }));
      const plotRoom = createElement('dd', 'card-plot');
      plotRoom.append(plot);
      row.append(term, value, unitRoom, plotRoom, limit);
      list.append(row);
      return {
        field,
        display: this.#displayOf(field),
        unit: new TextCell(unit),
        limit: new TextCell(limit),
        plot,
      };
    });
    this.#values = new NumberGrid(values);
    this.#strips = [];
    const strips = createElement('div', 'strips');
    for (const { name, ...rest } of shown) {
      if (!('leastRange' in rest)) continue;
      const behind = 'beside' in rest && has(rest.beside) ? [rest.beside] : [];
      strips.append(this.#strip([...behind, name], text[`${name}Name`], rest.leastRange));
    }
    this.#host.replaceChildren(strips, list);
  }

  #strip(fields: StripView['fields'], name: string, leastRange: number): HTMLElement {
    const figure = createElement('figure', 'strip');
    const past = this.#coming !== null;
    const said = past ? more().secondsAround(name, HALF_S) : more().lastSeconds(name, HISTORY_S);
    const caption = createElement('figcaption', 'quiet', said);
    if (fields.length > 1) caption.append(createElement('span', 'strip-key', more().refName));
    const box = document.createElementNS(SVG, 'svg');
    box.setAttribute('viewBox', `0 0 ${STRIP.width} ${STRIP.height}`);
    box.setAttribute('preserveAspectRatio', 'none');
    box.setAttribute('aria-hidden', 'true');
    const draw = (className: string) => {
      const path = document.createElementNS(SVG, 'path');
      path.setAttribute('class', className);
      box.append(path);
      return path;
    };
    const paths = fields.map((field) => draw(`trace trace-${field}`));
    const later = past ? fields.map((field) => draw(`trace trace-${field} trace-later`)) : [];
    if (past) draw('strip-moment').setAttribute('d', `M${STRIP.width / 2} 0V${STRIP.height}`);
    const low = createElement('span', 'strip-low unit');
    const high = createElement('span', 'strip-high unit');
    figure.append(caption, box, high, low);
    if (past) figure.append(createElement('span', 'strip-after unit', more().later));
    const range = { low: new TextCell(low), high: new TextCell(high) };
    this.#strips.push({ fields, leastRange, paths, later, ...range });
    return figure;
  }
}

/** The values of a trace from a moment on. */
function since({ agoS, values }: TraceHistory, fromS: number): TraceHistory {
  const first = agoS.findIndex((at) => at >= fromS);
  return first < 0 ? { agoS: [], values: [] } : { agoS: agoS.slice(first), values: values.slice(first) };
}

const SVG = 'http://www.w3.org/2000/svg';
