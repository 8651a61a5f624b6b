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

/** The table as CSV (RFC 4180). No reading gives an empty cell. Names come from the robot, so any that a spreadsheet would read
 *  as a formula get a leading apostrophe. */
export function csvOf({ atMs, columns }: Sheet): string {
  const head = ['time', ...columns.map(({ title, unit }) => (unit === '' ? title : `${title} [${unit}]`))];
  const rows = atMs.map((at, i) => [
    new Date(at).toISOString(),
    ...columns.map(({ values }) => numberOf(values[i] ?? null)),
  ]);
  return [head.map(quoted), ...rows].map((cells) => `${cells.join(',')}\r\n`).join('');
}

function quoted(text: string): string {
  const safe = /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
  return `"${safe.replaceAll('"', '""')}"`;
}

function numberOf(value: number | null): string {
  return value === null || !Number.isFinite(value) ? '' : String(Number(value.toPrecision(9)));
}
