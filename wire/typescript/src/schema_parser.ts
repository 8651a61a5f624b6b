/** Reads schemas. Apart from them, since a page shows schemas that its worker has read. */

import { entries, fail, items, member, number, parseJson, table, text, texts } from './checked.ts';
import { fnv1a32 } from './fnv.ts';
import { parseMapping } from './mapping_parser.ts';
import { Field, Schema } from './schema.ts';

const BITS_MAX = 28;
const CHANNELS_MAX = 4096;
export const SCHEMA_BYTES_MAX = 1 << 18;
const FIELD_NAME = /^[A-Za-z_][A-Za-z0-9_]{0,62}$/;

/** Read a schema's JSON text, ignoring unknown members. SchemaError names what is wrong and where. */
export function parseSchema(source: string): Schema {
  if (source.length > SCHEMA_BYTES_MAX) fail('schema', `longer than ${SCHEMA_BYTES_MAX} bytes`);
  const raw = new TextEncoder().encode(source);
  if (raw.length > SCHEMA_BYTES_MAX) fail('schema', `longer than ${SCHEMA_BYTES_MAX} bytes`);
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
  if (earlier.has(name)) fail(`${where}.name`, `'${name}' appears twice`);
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
