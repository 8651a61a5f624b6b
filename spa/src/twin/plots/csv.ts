/** The data of a plot as a table: one row for each time, one column for each trace. */
export interface Sheet {
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
