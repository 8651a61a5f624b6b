import './number_language.ts';
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { type AngleUnit, formatNumber, formatSpan } from '../../../twin/format.ts';
import { NUMBERS } from '../../../twin/joints.ts';
import { alone, isolated, withoutIsolates } from '../../../twin/names.ts';
import { HISTORY_S, type History } from '../../../twin/plots/history.ts';
import type { DerivedTraces, Trace } from '../../../twin/plots/trace.ts';
import {
  csvOf,
  type PlotData,
  type PlotGroup,
  type PlotTrace,
  plotData,
  plotGroups,
  sheetOf,
} from '../../../twin/plots/window.ts';
import type { SensorWords } from '../../../twin/sensors/sensors.ts';
import { shortenNames } from '../../../twin/short_names.ts';
import { createElement, TextCell } from '../../shell/cells.ts';
import { say } from '../../text/language.ts';
import type { More } from '../../text/more_en.ts';
import { letterWidths } from '../table/name_column.ts';

/** Colours of traces; from the fifth on they are also dashed. Red is left out, because it means a fault. */
const COLORS = {
  dark: ['#5aa9ff', '#e6b35a', '#4fd1b5', '#c59bff'],
  light: ['#1d6fd1', '#96600a', '#0a7a66', '#7b3fc4'],
} as const;
const DASHES: readonly (readonly number[])[] = [[], [7, 4]];

interface TraceStyle {
  readonly color: string;
  /** Dash pattern, CSS px: line, gap; empty for a solid line. */
  readonly dash: readonly number[];
}

function traceStyle(index: number, theme: 'dark' | 'light'): TraceStyle {
  const colors = COLORS[theme];
  return {
    color: colors[index % colors.length]!,
    dash: DASHES[Math.floor(index / colors.length) % DASHES.length]!,
  };
}

/** Where a name may wrap: after separators and before a capital. */
const WORD_ENDS = /[_./:-]+(?=[^_./:\s-])|\p{Ll}(?=\p{Lu})/gu;

/** A name in a legend. It wraps only between its words: "left_", "hip_", "pitch". If that does not fit into the lines there are, it is
 *  shortened, and a tap or mouse hover shows all of it. */
class LegendName {
  readonly element = createElement('span', 'plot-name');
  readonly #whole: string;
  #shown = '';

  /** `name` is followed by `rest`, the word of its field. */
  constructor(
    readonly name: string,
    readonly rest: string,
  ) {
    this.#whole = isolated(name) + rest;
    this.element.title = this.#whole;
    this.element.addEventListener('click', () =>
      this.#write(this.element.toggleAttribute('data-whole') ? this.#whole : this.#shown),
    );
    this.show();
  }

  /** Shows the name, or a shorter, `visible` one that stands for it. */
  show(short?: string): void {
    this.#shown = short === undefined ? this.#whole : alone(short) + this.rest;
    this.element.toggleAttribute('data-short', this.#shown !== this.#whole);
    if (!this.element.hasAttribute('data-whole')) this.#write(this.#shown);
  }

  get isCut(): boolean {
    const { clientWidth, clientHeight, scrollWidth, scrollHeight } = this.element;
    return scrollHeight > clientHeight + 1 || scrollWidth > clientWidth + 1;
  }

  #write(text: string): void {
    this.element.replaceChildren();
    for (const word of text.replace(WORD_ENDS, '$&\n').split('\n'))
      this.element.append(word, document.createElement('wbr'));
  }
}

/** Shortens those names that do not fit, so that each can be told from all others. */
function fitNames(names: readonly LegendName[]): void {
  for (const name of names) name.show();
  const cut = names.filter(({ isCut }) => isCut);
  if (cut.length === 0) return;
  const { fontWeight, fontSize, fontFamily } = getComputedStyle(cut[0]!.element);
  const widthOf = letterWidths(`${fontWeight} ${fontSize} ${fontFamily}`);
  const width = (text: string) => [...text].reduce((sum, letter) => sum + widthOf(letter), 0);
  // What fits into two lines if it breaks anywhere fits into four if it breaks between words.
  const room = 2 * Math.min(...cut.map(({ element }) => element.clientWidth));
  const texts = [...new Set(names.map(({ name }) => name))];
  const shown = shortenNames(texts, room - Math.max(...cut.map(({ rest }) => width(rest))), widthOf);
  for (const name of cut) name.show(shown[texts.indexOf(name.name)]!);
}

const HEIGHT_PX = { least: 130, most: 240 };
/** Minimum height of a plot in steps of the last digit, so that the noise of a joint at rest does not fill it. */
const LEAST_STEPS = 20;

interface Shown {
  readonly group: PlotGroup;
  readonly plot: uPlot;
  readonly values: readonly TextCell[];
  data: PlotData;
}

/** The texts in the plots. */
export type PlotWords = Pick<More, 'plotOf' | 'takeAway' | 'notReported' | 'ago' | keyof SensorWords>;

export interface PlotManner {
  readonly theme: 'dark' | 'light';
  readonly angle: AngleUnit;
  readonly words: PlotWords;
  /** Values that the page computes itself; null if none is plotted. */
  readonly derived: DerivedTraces | null;
  /** Removes a trace; null if the viewer didn't choose the traces. */
  readonly remove: ((trace: Trace) => void) | null;
  /** Called when the viewer zooms to a time span, which must then stop scrolling; null: zooming is off. */
  readonly zoomed: (() => void) | null;
}

/** The plots of the last minute, stacked, one for each unit, with a common cursor. */
export class PlotStack {
  readonly #host: HTMLElement;
  readonly #list: readonly Trace[];
  readonly #manner: PlotManner;
  readonly #resizes: ResizeObserver;
  readonly #timeRoom = createElement('p', 'plot-time quiet');
  readonly #time = new TextCell(this.#timeRoom);
  /** The schema whose values are shown. */
  #builtFor: History['schema'] | undefined;
  #shown: Shown[] = [];
  #names: LegendName[] = [];
  #computing = false;
  /** Position of the common cursor; null: none. */
  #at: number | null = null;

  constructor(host: HTMLElement, list: readonly Trace[], manner: PlotManner) {
    this.#host = host;
    this.#list = list;
    this.#manner = manner;
    this.#resizes = new ResizeObserver(() => this.#fit());
    this.#resizes.observe(host);
  }

  /** Shows the minute ending at `nowMs`. */
  write(history: History, nowMs: number): void {
    if (history.schema !== this.#builtFor) this.#build(history, nowMs);
    this.#computing = this.#manner.derived?.update(history, nowMs) ?? false;
    for (const shown of this.#shown) {
      shown.data = plotData(history, shown.group, nowMs);
      shown.plot.batch(() => {
        shown.plot.setData(aligned(shown.data), false);
        shown.plot.setScale('x', { min: -HISTORY_S, max: 0 });
      });
    }
    this.#tell();
  }

  /** Whether some of the values are still being computed; if so, call write again. */
  get computing(): boolean {
    return this.#computing;
  }

  /** The visible part of all plots as CSV. */
  csv(): string {
    const { min, max } = this.#shown[0]?.plot.scales.x ?? {};
    return csvOf(sheetOf(this.#shown, min ?? -HISTORY_S, max ?? 0));
  }

  dispose(): void {
    this.#resizes.disconnect();
    for (const { plot } of this.#shown) plot.destroy();
    this.#host.replaceChildren();
  }

  #build(history: History, nowMs: number): void {
    const { words, derived } = this.#manner;
    for (const { plot } of this.#shown) plot.destroy();
    this.#builtFor = history.schema;
    this.#names = [];
    const parts: HTMLElement[] = [];
    this.#shown = plotGroups(history, this.#list, this.#manner.angle, words, derived).map((group) => {
      const figure = createElement('figure', 'plot');
      const legend = createElement('ul', 'plot-legend');
      const values = group.traces.map((_, i) => this.#entry(legend, group, i));
      const canvas = createElement('div', 'plot-canvas');
      canvas.setAttribute('role', 'img');
      const titles = group.traces.map(titleOf).join(', ');
      canvas.setAttribute('aria-label', words.plotOf(titles, HISTORY_S));
      figure.append(legend, canvas);
      parts.push(figure);
      const data = plotData(history, group, nowMs);
      return { group, values, data, plot: new uPlot(this.#options(group), aligned(data), canvas) };
    });
    this.#host.replaceChildren(...parts, this.#timeRoom);
    this.#fit();
  }

  /** Creates one legend line; returns the cell for its value. */
  #entry(legend: HTMLElement, { display, traces }: PlotGroup, i: number): TextCell {
    const trace = traces[i]!;
    const { of, index, reading } = trace;
    const { words, remove: takeAway } = this.#manner;
    const { color, dash } = traceStyle(index, this.#manner.theme);
    const entry = createElement('li', '');
    entry.dataset.testid = takeAway === null ? 'own-trace' : 'trace';
    entry.dataset.field = of.field;
    entry.dataset.label = of.label;
    const swatch = createElement('i', 'plot-swatch');
    swatch.style.borderTop = `2px ${dash.length > 0 ? 'dashed' : 'solid'} ${color}`;
    const title = titleOf(trace);
    const name = new LegendName(...partsOf(trace));
    this.#names.push(name);
    const value = createElement('span', 'c-num');
    const unit = createElement('span', 'unit', reading === null ? words.notReported : display.unit);
    entry.append(swatch, name.element, value, unit);
    if (takeAway !== null) {
      const remove = createElement('button', 'icon-button', '×');
      remove.type = 'button';
      remove.setAttribute('aria-label', words.takeAway(title));
      remove.addEventListener('click', () => takeAway(of));
      entry.append(remove);
    }
    legend.append(entry);
    return new TextCell(value);
  }

  #options({ display, traces }: PlotGroup): uPlot.Options {
    const style = getComputedStyle(this.#host);
    const muted = style.getPropertyValue('--muted');
    const line = style.getPropertyValue('--line');
    const font = `11px ${style.fontFamily}`;
    const axis = { stroke: muted, font, grid: { stroke: line, width: 1 }, ticks: { show: false } };
    const least = LEAST_STEPS * 10 ** -display.decimals;
    return {
      ...this.#size(),
      legend: { show: false },
      cursor: {
        sync: { key: 'posecast' },
        drag: { x: this.#manner.zoomed !== null, y: false },
        y: false,
        points: { size: 6 },
      },
      scales: {
        x: { time: false },
        y: { range: (_, low, high) => roomFor(low, high, least) },
      },
      axes: [
        { ...axis, size: 26, values: (_, splits) => splits.map((s) => (s === 0 ? say().now : `${-s} s`)) },
        { ...axis, size: 54, values: (_, splits) => splits.map((v) => axisNumber(v, display.decimals)) },
      ],
      series: [
        {},
        ...traces.map(({ index }) => {
          const { color, dash } = traceStyle(index, this.#manner.theme);
          return { stroke: color, width: 1.5, dash: [...dash], spanGaps: false, points: { show: false } };
        }),
      ],
      hooks: {
        setCursor: [
          ({ cursor }) => {
            this.#at = cursor.idx ?? null;
            this.#tell();
          },
        ],
        setSelect: [({ select }) => select.width > 0 && this.#manner.zoomed?.()],
        ready: [(plot) => followFinger(plot)],
      },
    };
  }

  /** Writes the values at the cursor, or else the newest ones, to the legends. */
  #tell(): void {
    for (const { group, values, data } of this.#shown) {
      const at = this.#at ?? data.s.length - 1;
      values.forEach((cell, i) => {
        const value = data.columns[i]?.[at] ?? null;
        cell.set(formatNumber(value, { ...group.display, factor: 1 }));
      });
    }
    const s = this.#at === null ? undefined : this.#shown[0]?.data.s[this.#at];
    this.#time.set(s === undefined ? '' : this.#manner.words.ago(formatSpan(-s * 1000)));
  }

  #size(): { width: number; height: number } {
    const plots = Math.max(1, this.#shown.length);
    const room = (this.#host.clientHeight - 20) / plots - 40;
    const width = Math.max(120, this.#host.clientWidth - 16);
    const most = Math.max(HEIGHT_PX.most, width / 3);
    return { width, height: Math.max(HEIGHT_PX.least, Math.min(most, room)) };
  }

  #fit(): void {
    fitNames(this.#names);
    const size = this.#size();
    for (const { plot } of this.#shown) {
      if (plot.width !== size.width || plot.height !== size.height) plot.setSize(size);
    }
  }
}

/** "RKN pos", using the page's word for the column; "right foot Fz". */
function titleOf(trace: PlotTrace): string {
  const [name, rest] = partsOf(trace);
  return isolated(name) + rest;
}

/** A title's name, which can be shortened, and what follows it. */
function partsOf({ of, reading }: PlotTrace): [name: string, rest: string] {
  const { field, label } = of;
  const ofTable = NUMBERS.find(({ name }) => name === field);
  if (reading !== null && !reading.ofJoint) return [withoutIsolates(reading.title), ''];
  return [label, ` ${ofTable === undefined ? field : say()[ofTable.name]}`];
}

function aligned({ s, columns }: PlotData): uPlot.AlignedData {
  return [s as number[], ...(columns as (number | null)[][])];
}

/** The range of the y axis: some room above and below the values, and at least `least`. */
function roomFor(low: number | null, high: number | null, least: number): [number, number] {
  if (low === null || high === null) return [0, 1];
  const middle = (low + high) / 2;
  const half = Math.max((high - low) * 0.55, least / 2);
  return [middle - half, middle + half];
}

function axisNumber(value: number, decimals: number): string {
  return String(Number(value.toFixed(decimals))).replace('-', '−');
}

/** Adds touch to uPlot, which handles only the mouse: sideways moves the cursor, up and down scrolls the page. */
function followFinger(plot: uPlot): void {
  plot.over.style.touchAction = 'pan-y';
  const place = (event: PointerEvent) => {
    if (event.pointerType === 'mouse') return;
    const { left, top } = plot.over.getBoundingClientRect();
    plot.setCursor({ left: event.clientX - left, top: event.clientY - top });
  };
  plot.over.addEventListener('pointerdown', place);
  plot.over.addEventListener('pointermove', place);
}
