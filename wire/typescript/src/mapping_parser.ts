/** Reads the `mapping` member of a schema. */

import { entries, fail, items, member, number, table, text } from './checked.ts';
import {
  type JointMap,
  Mapping,
  SENSOR_KINDS,
  SEVERITIES,
  type SensorMount,
  type Sentence,
  type Severity,
  type Threshold,
  type Xyz,
} from './mapping.ts';

const LANGUAGES_MAX = 16; // of one bit
const SENTENCES_BYTES_MAX = 32 << 10; // in UTF-8: every viewer gets them before the first frame

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
