import { type AngleUnit, type Display, displayOf } from '../format.ts';
import { isolated } from '../names.ts';
import type { SensorWords } from '../sensors/sensors.ts';
import type { History } from './history.ts';
import { type DerivedTraces, type Trace, type TraceReading, traceReading } from './trace.ts';

/** The data of a plot as a table: one row for each time, one column for each trace. */
interface Sheet {
  /** Unix, ms. */
  readonly atMs: readonly number[];
  readonly columns: readonly {
    readonly title: string;
    readonly unit: string;
    readonly values: readonly (number | null)[];
  }[];
}

/** Where a formula could begin. Some spreadsheets split lines at `;`, a tab or a sign of the user's choice, whatever is quoted,
 *  and in East Asia a wide `=` is one too. So every sign counts, except inside a name. */
const FORMULA = /(?<![\p{L}\p{N}_.()[\]{}<>=+\-@＝＋－＠])[=+\-@＝＋－＠]/gu;

/** A text from the robot with an apostrophe in front of what a spreadsheet could read as a formula. */
export function withoutFormulas(text: string): string {
  return text.replace(FORMULA, "'$&");
}

/** The table as CSV (RFC 4180). No reading gives an empty cell. */
export function csvOf({ atMs, columns }: Sheet): string {
  const head = ['time', ...columns.map(({ title, unit }) => (unit === '' ? title : `${title} [${unit}]`))];
  const rows = atMs.map((at, i) => [
    new Date(at).toISOString(),
    ...columns.map(({ values }) => numberOf(values[i] ?? null)),
  ]);
  return [head.map(quoted), ...rows].map((cells) => `${cells.join(',')}\r\n`).join('');
}

function quoted(text: string): string {
  return `"${withoutFormulas(text).replaceAll('"', '""')}"`;
}

function numberOf(value: number | null): string {
  return value === null || !Number.isFinite(value) ? '' : String(Number(value.toPrecision(9)));
}

/** A longer pause between two frames breaks the line, because the values in between are unknown. */
const GAP_MS = 1500;

export interface PlotTrace {
  readonly of: Trace;
  /** Its index in the list of all traces, which determines its colour and line style. */
  readonly index: number;
  /** null: the robot reports no such value now. */
  readonly reading: TraceReading | null;
}

/** One plot: all traces with the same unit. */
export interface PlotGroup {
  readonly display: Display;
  readonly traces: readonly PlotTrace[];
}

/** Groups the traces into plots by unit, in the order of the list. Traces that the robot does not report and that are not
 *  `derived` come last. */
export function plotGroups(
  history: History,
  list: readonly Trace[],
  angle: AngleUnit,
  words?: SensorWords,
  derived: DerivedTraces | null = null,
): PlotGroup[] {
  const groups = new Map<string, { display: Display; traces: PlotTrace[] }>();
  list.forEach((of, index) => {
    const { schema } = history;
    const reading =
      schema === null ? null : (traceReading(schema, of, words) ?? derived?.reading(of) ?? null);
    const display = displayOf(reading?.unit ?? '', angle, reading?.scale);
    const key = reading === null ? '\n' : display.unit;
    const group = groups.get(key) ?? { display, traces: [] };
    groups.set(key, group);
    group.traces.push({ of, index, reading });
  });
  return [...groups].sort(([a], [b]) => Number(a === '\n') - Number(b === '\n')).map(([, group]) => group);
}

/** The last minute of one group, in the displayed unit. `s`: the times in seconds relative to `nowMs`, all ≤ 0. */
export interface PlotData {
  readonly atMs: readonly number[];
  readonly s: readonly number[];
  readonly columns: readonly (readonly (number | null)[])[];
}

export function plotData(history: History, { display, traces }: PlotGroup, nowMs: number): PlotData {
  const readers = traces.map(({ reading }) => reading?.read ?? (() => null));
  const { atMs, columns } = history.window(readers, nowMs);
  const times: number[] = [];
  const shown: (number | null)[][] = columns.map(() => []);
  atMs.forEach((at, i) => {
    const before = atMs[i - 1];
    if (before !== undefined && at - before > GAP_MS) {
      times.push((before + at) / 2);
      for (const column of shown) column.push(null);
    }
    times.push(at);
    shown.forEach((column, c) => {
      const value = columns[c]![i]!;
      column.push(value === null ? null : value * display.factor);
    });
  });
  return { atMs: times, s: times.map((at) => (at - nowMs) / 1000), columns: shown };
}

/** The part of all plots between two times (seconds, as in `PlotData.s`) as a table. All plots must have the same
 *  times. */
export function sheetOf(
  plots: readonly { readonly group: PlotGroup; readonly data: PlotData }[],
  fromS: number,
  toS: number,
): Sheet {
  const [first] = plots;
  const inside = (first?.data.s ?? []).flatMap((s, i) => (s >= fromS && s <= toS ? [i] : []));
  return {
    atMs: inside.map((i) => first!.data.atMs[i]!),
    columns: plots.flatMap(({ group, data }) =>
      group.traces.map(({ of, reading }, c) => ({
        title: reading?.title ?? `${isolated(of.label)} ${of.field}`,
        unit: group.display.unit,
        values: inside.map((i) => data.columns[c]![i]!),
      })),
    ),
  };
}
