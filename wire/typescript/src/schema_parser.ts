/** Reads schemas. Apart from them, since a page shows schemas that its worker has read. */

import { entries, fail, items, member, number, parseJson, table, text, texts } from './checked.ts';
import { fnv1a32 } from './frame.ts';
import {
  Field,
  type JointMap,
  Mapping,
  Schema,
  SENSOR_KINDS,
  SEVERITIES,
  type SensorMount,
  type Sentence,
  type Severity,
  type Threshold,
  type Xyz,
} from './schema.ts';

const BITS_MAX = 28;
const CHANNELS_MAX = 4096;
export const SCHEMA_BYTES_MAX = 1 << 18;
const FIELD_NAME = /^[A-Za-z_][A-Za-z0-9_]{0,62}$/;
const LANGUAGES_MAX = 16; // of one bit
const SENTENCES_BYTES_MAX = 32 << 10; // in UTF-8: every viewer gets them before the first frame

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

/** The `mapping` member of a schema, parsed from JSON. SchemaError names what and where. */
export function parseMapping(value: unknown): Mapping {
  const doc = table(value, 'mapping');
  const part = <T>(name: string, read: (v: unknown, at: string, key: string) => T): Map<string, T> =>
    entries(doc.get(name), `mapping.${name}`, read);
  return new Mapping(
    part('joints', joint),
    part('sensors', sensor),
    part('names', text),
    part('thresholds', (v, at) => entries(v, at, threshold)),
    part('tolerance', atLeastZero),
    part('severity', (v, at) => entries(v, at, severity)),
    part('units', (v, at) => entries(v, at, text)),
    part('translated_names', (v, at) => entries(v, at, text)),
    atMost(part('explain', (v, at) => entries(v, at, byLanguage))),
  );
}

function joint(value: unknown, where: string): JointMap {
  const doc = table(value, where);
  const terms = items(doc.get('terms'), `${where}.terms`).map((item, i): readonly [string, number] => {
    const at = `${where}.terms[${i}]`;
    const pair = items(item, at);
    if (pair.length !== 2) fail(at, 'must be [channel, gain]');
    return [text(pair[0], `${at}[0]`), number(pair[1], `${at}[1]`)];
  });
  return { terms, offset: number(member(doc, 'offset', 0), `${where}.offset`) };
}

function sensor(value: unknown, where: string, site: string): SensorMount {
  const doc = table(value, where);
  const kind = text(doc.get('kind'), `${where}.kind`);
  const known = SENSOR_KINDS.find((k) => k === kind);
  if (!known) fail(`${where}.kind`, `'${kind}' is none of ${SENSOR_KINDS.join(', ')}`);
  const link = doc.get('link') ?? null;
  return {
    kind: known,
    name: text(member(doc, 'name', site), `${where}.name`),
    link: link === null ? null : text(link, `${where}.link`),
    xyz: xyz(member(doc, 'xyz', [0, 0, 0]), `${where}.xyz`),
    rpy: xyz(member(doc, 'rpy', [0, 0, 0]), `${where}.rpy`),
  };
}

export function xyz(value: unknown, where: string): Xyz {
  const found = items(value, where);
  if (found.length !== 3) fail(where, 'must be three numbers');
  const [x, y, z] = found.map((v, i) => number(v, `${where}[${i}]`));
  return [x!, y!, z!];
}

function threshold(value: unknown, where: string): Threshold {
  const doc = table(value, where);
  const limit = (name: string): number | null => {
    const found = doc.get(name) ?? null;
    return found === null ? null : number(found, `${where}.${name}`);
  };
  const [low, high] = [limit('low'), limit('high')];
  const caution = number(member(doc, 'caution', 1), `${where}.caution`);
  if (!(caution > 0 && caution <= 1)) fail(`${where}.caution`, 'must lie above 0 and not above 1');
  if (low !== null && high !== null && low >= high) fail(where, 'low must lie below high');
  return { low, high, caution };
}

function atLeastZero(value: unknown, where: string): number {
  const found = number(value, where);
  if (found < 0) fail(where, 'must not be negative');
  return found;
}

function sentence(value: unknown, where: string): Sentence {
  const doc = table(value, where);
  const why = doc.get('why') ?? null;
  return { say: text(doc.get('say'), `${where}.say`), why: why === null ? null : text(why, `${where}.why`) };
}

function byLanguage(value: unknown, where: string): Map<string, Sentence> {
  if (table(value, where).size > LANGUAGES_MAX) fail(where, `more than ${LANGUAGES_MAX} languages`);
  return entries(value, where, sentence);
}

type Sentences = Map<string, Map<string, Map<string, Sentence>>>;

function atMost(found: Sentences): Sentences {
  const utf8 = new TextEncoder();
  let bytes = 0;
  for (const bits of found.values())
    for (const languages of bits.values())
      for (const { say, why } of languages.values()) bytes += utf8.encode(say + (why ?? '')).length;
  if (bytes > SENTENCES_BYTES_MAX)
    fail('mapping.explain', `more than ${SENTENCES_BYTES_MAX} bytes of sentences in all`);
  return found;
}

function severity(value: unknown, where: string): Severity {
  const known = SEVERITIES.find((s) => s === value);
  if (!known) fail(where, `must be one of ${SEVERITIES.join(', ')}`);
  return known;
}
