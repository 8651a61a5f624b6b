import { type Field, MISSING, type Schema } from '@posecast/wire';
import type { BalanceReader } from '../../model/balance/balance_reader.ts';
import type { Manifest } from '../../model/manifest.ts';
import type { Balance } from '../../twin/balance/balance.ts';
import { withoutFormulas } from '../../twin/plots/window.ts';
import type { Vec3 } from '../../twin/rotation.ts';
import {
  BlobParts,
  framesOf,
  modelsOf,
  type SavedFrame,
  type SavedSpan,
  type SavePorts,
} from './saved_span.ts';

/** Rows built at a time. */
const ROWS = 32;
const BYTE_ORDER_MARK = '\ufeff';
/** Significant digits of a step, because one like 1/30 has infinitely many. */
const STEP_DIGITS_MAX = 6;
/** No bit is set, as opposed to an empty cell, which means no reading. */
const NONE_SET = '0';
const FIRST = ['time', 'seconds', 'robot_time'];
const METRE_DECIMALS = 4;
const MM_DECIMALS = 1;

/** The CSV columns for balance, after those of the channels. */
const BALANCE_COLUMNS: readonly string[] = [
  ...['x', 'y', 'z'].map((axis) => `balance.centre_of_mass.${axis} [m]`),
  ...['x', 'y'].map((axis) => `balance.capture_point.${axis} [m]`),
  ...['x', 'y'].map((axis) => `balance.centre_of_pressure.${axis} [m]`),
  'balance.floor [m]',
  'balance.margin [mm]',
];

/** Writes the frames in a span as a table: one row for each frame, one column for each channel, then the balance if a model with
 *  masses or feet is available. */
export async function writeCsv(
  span: SavedSpan,
  { models, breathe, signal }: Pick<SavePorts, 'models' | 'breathe' | 'signal'>,
  onPart: (part: number) => void,
): Promise<{ readonly blob: Blob; readonly lostModels: number }> {
  const file = new BlobParts();
  const manifests = await loadManifests(span, { models, signal });
  const readBalance = await loadBalance(span, manifests);
  const table = new CsvTable(span.schemas.values(), readBalance ? BALANCE_COLUMNS : []);
  const timeline = new ModelTimeline(span);
  let lines = BYTE_ORDER_MARK + table.head;
  let count = 0;
  for (const frame of framesOf(span, onPart)) {
    const manifest = manifests.get(timeline.at(frame.atUs) ?? '') ?? null;
    lines += table.row(frame, readBalance ? balanceCells(readBalance(frame, manifest)) : []);
    if (++count % ROWS > 0) continue;
    file.write(lines);
    lines = '';
    await breathe();
    signal.throwIfAborted();
  }
  file.write(lines);
  return { blob: file.blob('text/csv'), lostModels: 0 };
}

/** The columns of some schemas: those of the first, then any additional ones, then `more`. */
export class CsvTable {
  readonly #columns = new Map<string, number>();
  readonly #cellsOf = new Map<string, readonly Cell[]>();
  #firstMs: number | null = null;

  constructor(
    schemas: Iterable<Schema>,
    readonly more: readonly string[] = [],
  ) {
    for (const schema of schemas)
      this.#cellsOf.set(
        schema.text,
        schema.fields.flatMap((field) => field.labels.map((label, i) => this.#cell(schema, field, label, i))),
      );
  }

  get head(): string {
    return lineOf([...FIRST, ...[...this.#columns.keys()].map(cellOf), ...this.more]);
  }

  /** The row of a frame; `more`: the last cells. */
  row({ schema, atUs, tS, codes }: SavedFrame, more: readonly string[] = []): string {
    const atMs = Math.floor(atUs / 1000);
    this.#firstMs ??= atMs;
    const cells = new Array<string>(FIRST.length + this.#columns.size).fill('');
    cells[0] = new Date(atMs).toISOString();
    cells[1] = ((atMs - this.#firstMs) / 1000).toFixed(3);
    cells[2] = tS.toFixed(3);
    for (const { column, text } of this.#cellsOf.get(schema.text)!) cells[column] = text(codes);
    return lineOf([...cells, ...more]);
  }

  #cell(schema: Schema, field: Field, label: string, i: number): Cell {
    const unit = schema.mapping.unit(field.name, label) ?? field.unit;
    const head = `${field.name}.${label}${unit === '' ? '' : ` [${unit}]`}`;
    const column = this.#columns.get(head) ?? this.#columns.size;
    this.#columns.set(head, column);
    const at = field.start + i;
    const text =
      field.bits.length > 0 ? (codes: Int32Array) => cellOf(bitsOf(field, codes[at]!)) : numberOf(field, at);
    return { column: FIRST.length + column, text };
  }
}

interface Cell {
  readonly column: number;
  readonly text: (codes: Int32Array) => string;
}

/** The number of decimals for values with this step: those of the step itself, rounded to six significant digits. */
export function decimalsOf(step: number): number {
  const [digits, exponent] = step.toExponential().split('e') as [string, string];
  const more = Math.max(0, digits.length - 2); // the digits after the first one, and the point
  return Math.max(0, Math.min(more, STEP_DIGITS_MAX - 1) - Number(exponent));
}

/** The names of set bits; `|` and `\` in a name are escaped with `\`. */
function bitsOf(field: Field, code: number): string {
  if (code === MISSING) return '';
  const names = field.bitsSet(code).map((name) => name.replace(/[\\|]/g, '\\$&'));
  return names.join('|') || NONE_SET;
}

function numberOf(field: Field, at: number): Cell['text'] {
  const decimals = decimalsOf(field.scale);
  return (codes) => field.value(codes[at]!)?.toFixed(decimals) ?? '';
}

/** A text as a cell. */
export function cellOf(text: string): string {
  const safe = withoutFormulas(text);
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

function lineOf(cells: readonly string[]): string {
  return `${cells.join(',')}\r\n`;
}

/** The cells of balance; empty if there is no value. */
function balanceCells(balance: Balance | null): readonly string[] {
  if (balance === null) return BALANCE_COLUMNS.map(() => '');
  const { centreOfMass, capturePoint, pressure, floorM, marginM } = balance;
  return [
    ...pointCells(centreOfMass, 3),
    ...pointCells(capturePoint, 2),
    ...pointCells(pressure, 2),
    cell(floorM, METRE_DECIMALS),
    cell(marginM === null ? null : 1000 * marginM, MM_DECIMALS),
  ];
}

function pointCells(point: Vec3 | null, axes: number): string[] {
  return Array.from({ length: axes }, (_, axis) => cell(point?.[axis] ?? null, METRE_DECIMALS));
}

/** Without a minus sign before zero. */
function cell(value: number | null, decimals: number): string {
  return value?.toFixed(decimals).replace(/^-(?=[0.]+$)/, '') ?? '';
}

/** The manifests of the models in a span, by hash; null for one that is unavailable. Rejects with the reason of the signal. */
async function loadManifests(
  span: SavedSpan,
  { models, signal }: Pick<SavePorts, 'models' | 'signal'>,
): Promise<ReadonlyMap<string, Manifest | null>> {
  const manifests = new Map<string, Manifest | null>();
  for (const { model } of modelsOf(span)) {
    if (model === null || manifests.has(model)) continue;
    signal.throwIfAborted();
    manifests.set(model, await models.manifest(model).catch(() => null));
  }
  return manifests;
}

/** Reads the balance of a span's frames, in order, with these models; null if there is none. The code, which also draws balance,
 *  is loaded only if a model is available. */
async function loadBalance(
  { schemas }: Pick<SavedSpan, 'schemas'>,
  manifests: ReadonlyMap<string, Manifest | null>,
): Promise<((frame: SavedFrame, manifest: Manifest | null) => Balance | null) | null> {
  const models = [...manifests.values()].filter((manifest) => manifest !== null);
  if (models.length === 0) return null;
  const { BalanceReader } = await import('../../model/balance/balance_reader.ts');
  const all = [...schemas.values()];
  if (!models.some((model) => all.some((schema) => new BalanceReader(model, schema).hasAny))) return null;
  let reader: BalanceReader | null = null;
  return ({ schema, codes, tS }, manifest) => {
    if (manifest === null) reader = null;
    // each decoder has one schema
    else if (reader?.manifest !== manifest || reader.schema.text !== schema.text)
      reader = new BalanceReader(manifest, schema);
    return reader?.hasAny ? reader.ofFrame(codes, tS) : null;
  };
}

/** The robot's model at moments, which must be requested in time order. */
class ModelTimeline {
  readonly #models: ReturnType<typeof modelsOf>;

  constructor(span: SavedSpan) {
    this.#models = modelsOf(span);
  }

  /** Its hash; null without a model. `atUs`: unix. */
  at(atUs: number): string | null {
    while (this.#models.length > 1 && this.#models[1]!.atUs <= atUs) this.#models.shift();
    return this.#models[0]?.model ?? null;
  }
}
