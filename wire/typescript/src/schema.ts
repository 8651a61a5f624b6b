/** The schema of a stream: its channels, their order, and the unit and scale of their codes. */

import { entries, fail, items, member, number, parseJson, table, text, texts } from './checked.ts';
import { fnv1a32 } from './fnv.ts';
import { Mapping, parseMapping } from './mapping.ts';

/** The code of "no reading". */
export const MISSING = -(2 ** 28);
/** Readings lie in -CODE_MAX … CODE_MAX. */
export const CODE_MAX = 2 ** 28 - 1;

const BITS_MAX = 28;
const CHANNELS_MAX = 4096;
const TEXT_BYTES_MAX = 1 << 18;
const FIELD_NAME = /^[A-Za-z_][A-Za-z0-9_]{0,62}$/;

/** Channels `start` … `start + size - 1` of the code vector; value = code × scale, in `unit`. */
export class Field {
  readonly size: number;

  constructor(
    readonly name: string,
    readonly labels: readonly string[],
    readonly labelSet: string,
    readonly unit: string,
    readonly scale: number,
    /** The earlier field whose movement this one shares. */
    readonly rel: string | null,
    /** Names, lowest bit first; empty for a number. */
    readonly bits: readonly string[],
    readonly slow: boolean,
    readonly start: number,
  ) {
    this.size = labels.length;
  }

  /** The value of one code, null where there is no reading. */
  value(code: number): number | null {
    return code === MISSING ? null : code * this.scale;
  }

  /** Names of the bits set in one code of a `bits` field; a bit without a name reads `bit N`. */
  bitsSet(code: number): string[] {
    const set: string[] = [];
    if (code !== MISSING)
      for (let i = 0; code >> i; i++) if ((code >> i) & 1) set.push(this.bits[i] ?? `bit ${i}`);
    return set;
  }
}

/** A schema as `parseSchema` reads it. `text` is the exact text received; `id` its FNV-1a-32, which KEY frames name. */
export class Schema {
  private readonly byName: ReadonlyMap<string, Field>;

  constructor(
    readonly text: string,
    readonly id: number,
    readonly robot: string,
    readonly fields: readonly Field[],
    readonly size: number,
    readonly mapping: Mapping,
  ) {
    this.byName = new Map(fields.map((f) => [f.name, f]));
  }

  /** No KEY of this schema is longer (SPEC §4): a code takes 63 bits at most, its order 4. */
  get keyBytesMax(): number {
    return 17 + Math.ceil((4 * this.fields.length + 67 * this.size) / 8);
  }

  /** Likewise of a REF or plain frame. */
  get frameBytesMax(): number {
    return 9 + Math.ceil((4 * this.fields.length + 63 * this.size) / 8);
  }

  field(name: string): Field | null {
    return this.byName.get(name) ?? null;
  }
}

/** Read a schema's JSON text, ignoring unknown members. SchemaError names what is wrong and where. */
export function parseSchema(source: string): Schema {
  if (source.length > TEXT_BYTES_MAX) fail('schema', `longer than ${TEXT_BYTES_MAX} bytes`);
  const raw = new TextEncoder().encode(source);
  if (raw.length > TEXT_BYTES_MAX) fail('schema', `longer than ${TEXT_BYTES_MAX} bytes`);
  const doc = table(document(source), 'schema');
  if (doc.get('type') !== 'schema') fail('type', 'must be "schema"');
  if (doc.get('v') !== 1) fail('v', 'this reader knows version 1 only');
  const sets = entries(doc.get('labels'), 'labels', (v, at) => texts(v, at, CHANNELS_MAX));
  const fields = new Map<string, Field>();
  let size = 0;
  items(doc.get('fields'), 'fields').forEach((item, i) => {
    const where = `fields[${i}]`;
    const field = parseField(table(item, where), where, sets, fields, size);
    fields.set(field.name, field);
    size += field.size;
    if (size > CHANNELS_MAX) fail(where, `more than ${CHANNELS_MAX} channels in all`);
  });
  if (size === 0) fail('fields', 'must name at least one field');
  const mapping = parseMapping(doc.get('mapping'));
  const robot = text(doc.get('robot'), 'robot');
  return new Schema(source, fnv1a32(raw), robot, [...fields.values()], size, mapping);
}

/** A schema that has come through `postMessage`, which takes the classes off: gives them back, in place. */
export function revived(schema: Schema): Schema {
  for (const field of schema.fields) Object.setPrototypeOf(field, Field.prototype);
  Object.setPrototypeOf(schema.mapping, Mapping.prototype);
  return Object.setPrototypeOf(schema, Schema.prototype) as Schema;
}

function document(source: string): unknown {
  try {
    return parseJson(source);
  } catch (e) {
    return fail('schema', `not JSON: ${(e as Error).message}`);
  }
}

function parseField(
  doc: ReadonlyMap<string, unknown>,
  where: string,
  sets: ReadonlyMap<string, readonly string[]>,
  earlier: ReadonlyMap<string, Field>,
  start: number,
): Field {
  const name = text(doc.get('name'), `${where}.name`);
  if (!FIELD_NAME.test(name))
    fail(`${where}.name`, `'${name}' must be a letter or _ and then letters, digits or _, 63 at most`);
  if (earlier.has(name)) fail(`${where}.name`, `'${name}' stands there twice`);
  const labelSet = text(doc.get('labels'), `${where}.labels`);
  const labels = sets.get(labelSet);
  if (!labels?.length) fail(`${where}.labels`, `no such label set, or an empty one: '${labelSet}'`);
  const scale = number(member(doc, 'scale', 1), `${where}.scale`);
  if (!(scale >= 1e-12 && scale <= 1e12)) fail(`${where}.scale`, 'must lie between 1e-12 and 1e12');
  const unit = member(doc, 'unit', '');
  const bits = texts(member(doc, 'bits', []), `${where}.bits`, BITS_MAX);
  if (bits.length && scale !== 1) fail(`${where}.scale`, 'a field of bits has scale 1');
  const rel = doc.get('rel') ?? null;
  if (rel !== null) {
    const partner = earlier.get(text(rel, `${where}.rel`));
    if (!partner) fail(`${where}.rel`, `no earlier field '${rel}'`);
    if (partner.size !== labels.length)
      fail(`${where}.rel`, `'${partner.name}' has ${partner.size} channels, not ${labels.length}`);
  }
  const slow = member(doc, 'slow', false);
  if (typeof slow !== 'boolean') fail(`${where}.slow`, 'must be true or false');
  return new Field(
    name,
    labels,
    labelSet,
    unit === '' ? '' : text(unit, `${where}.unit`),
    scale,
    rel === null ? null : String(rel),
    bits,
    slow,
    start,
  );
}
