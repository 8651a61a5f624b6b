/** What strangers send costs no more than in proportion to its length, whatever it is. */

import fc from 'fast-check';
import { describe, expect, test, vi } from 'vitest';
import {
  CODE_MAX,
  Decoder,
  fnv1a32,
  JointMapping,
  MISSING,
  parseRelayMessage,
  parseSchema,
  type Schema,
} from '../src/index.ts';
import { expectNoFasterThanInput } from './cost.ts';

vi.setConfig({ testTimeout: 60_000 });

type Doc = Record<string, unknown>;

const names = (count: number): string[] => Array.from({ length: count }, (_, i) => i.toString(16));
const times = <T>(count: number, value: T): T[] => new Array<T>(Math.floor(count)).fill(value);
const each = <T>(keys: readonly string[], value: T): Record<string, T> =>
  Object.fromEntries(keys.map((key) => [key, value]));

function schemaText(members: Doc = {}): string {
  const fields = [{ name: 'a', labels: 'j' }];
  return JSON.stringify({
    type: 'schema',
    v: 1,
    robot: 'r',
    labels: { j: ['x'] },
    fields,
    more: 'MORE',
    ...members,
  });
}

const mapped = (parts: Doc): string => schemaText({ mapping: parts });
const withMore = (json: string): string => schemaText().replace('"MORE"', () => json);

/** One channel a field, each relative to the one before. */
function chain(fields: number): string {
  const of = Array.from({ length: fields }, (_, i) => ({
    name: `f${i}`,
    labels: 'j',
    ...(i && { rel: `f${i - 1}` }),
  }));
  return schemaText({ fields: of });
}

/** Texts of about n characters. */
const SCHEMAS: Record<string, (n: number) => string> = {
  'a label twice, at the end': (n) => schemaText({ labels: { j: [...names(n >> 6), '0'] } }),
  'too many labels': (n) => schemaText({ labels: { j: [...names(n >> 3), '0'] } }),
  'many labels': (n) => schemaText({ labels: { j: names(n >> 6) } }),
  'labels of a set with a long name': (n) => schemaText({ labels: { ['k'.repeat(n >> 1)]: names(n >> 4) } }),
  'many sets': (n) => schemaText({ labels: each(names(n >> 4), ['x']) }),
  'a long label': (n) => schemaText({ labels: { j: ['é'.repeat(n >> 1)] } }),
  'a chain of fields': (n) => chain(n >> 6),
  'many bits': (n) => schemaText({ fields: [{ name: 'a', labels: 'j', bits: names(n >> 3) }] }),
  'many terms': (n) => mapped({ joints: { a: { terms: times(n >> 4, ['x', 1]) } } }),
  'many joints': (n) => mapped({ joints: each(names(n / 20), { terms: [] }) }),
  'a long place': (n) => mapped({ units: { ['k'.repeat(200)]: each(names(n >> 4), 'mm') } }),
  'a long key': (n) => mapped({ units: { k: { ['k'.repeat(n)]: '' } } }),
  'a long vector': (n) => mapped({ sensors: { a: { kind: 'imu', xyz: times(n >> 2, 0) } } }),
  'keys that look like indices': (n) =>
    withMore(
      JSON.stringify(
        each(
          times(n >> 4, 7).map((s, i) => `${s * i}`),
          0,
        ),
      ),
    ),
  depth: (n) => withMore('['.repeat(n >> 1) + ']'.repeat(n >> 1)),
  'many lists': (n) => withMore(`[${'[],'.repeat(n >> 2)}0]`),
  'many numbers': (n) => withMore(`[${'0,'.repeat(n >> 2)}0]`),
  'one number': (n) => withMore('7'.repeat(n)),
  'one key again and again': (n) => withMore(`{${'"a":0,'.repeat(n >> 3)}"a":0}`),
  escapes: (n) => withMore(`"${'\\ud83e\\uddbe'.repeat(n >> 4)}"`),
  'halves of pairs': (n) => withMore(`"${'\\udc00'.repeat(n >> 3)}"`),
  'no end': (n) => '{"a":'.repeat(n >> 3),
};

describe.each(Object.entries(SCHEMAS))('%s', (_, make) => {
  test('schema', () => expectNoFasterThanInput(make, (text) => parseSchema(text), 15_000));

  test('message', () => {
    const messages = (n: number): string => `{"type":"pong","t":1,"more":${make(n)}}`;
    expectNoFasterThanInput(messages, (text) => parseRelayMessage(text), 15_000);
  });
});

test('info', () => {
  const info = (n: number): string => JSON.stringify({ type: 'info', kv: each(names(n >> 4), 'é') });
  expectNoFasterThanInput(info, (text) => parseRelayMessage(text), 15_000);
});

test('joints', () => {
  const schemaOf = (n: number): Schema =>
    parseSchema(
      mapped({ joints: { ...each(names(n >> 6), { terms: [] }), a: { terms: times(n >> 5, ['x', 1]) } } }),
    );
  const evaluate = (schema: Schema): void => {
    new JointMapping(schema, 'a').evaluate(new Int32Array(schema.size));
  };
  expectNoFasterThanInput(schemaOf, evaluate, 15_000);
});

/** A KEY of one channel a field whose codes go from end to end of the range, in 59 bits each. */
function longestKey(schema: Schema): { readonly key: Uint8Array; readonly codes: readonly number[] } {
  const codes = schema.fields.map((_, i) => (i % 2 ? CODE_MAX : MISSING));
  const bits = codes.map((code, i) => {
    const residual = code - (i ? codes[i - 1]! : 0);
    const x = (residual < 0 ? -2 * residual - 1 : 2 * residual) + 1;
    return `0000${x.toString(2).padStart(2 * x.toString(2).length - 1, '0')}`;
  });
  const body = `${bits.join('')}${'0100'.repeat(schema.size)}`;
  const key = new Uint8Array(17 + Math.ceil(body.length / 8));
  const view = new DataView(key.buffer);
  view.setUint8(0, 0x13);
  view.setUint32(1, fnv1a32(new TextEncoder().encode(schema.text)), true);
  for (let i = 17; i < key.length; i++)
    key[i] = Number.parseInt(body.slice(8 * (i - 17), 8 * (i - 16)).padEnd(8, '0'), 2);
  return { key, codes };
}

test('4096 channels at their longest', () => {
  const decoder = new Decoder();
  const schema = decoder.addSchema(chain(4096));
  const { key, codes } = longestKey(schema);
  expect(Array.from(decoder.decode(key).codes)).toEqual(codes);
  expect(key.length).toBeLessThanOrEqual(schema.keyBytesMax);
  expect(key.length).toBeGreaterThan(0.9 * schema.keyBytesMax);
});

test('frame', () => {
  const made = (fields: number): { decoder: Decoder; key: Uint8Array } => {
    const decoder = new Decoder();
    return { decoder, key: longestKey(decoder.addSchema(chain(fields))).key };
  };
  expectNoFasterThanInput(made, ({ decoder, key }) => decoder.decode(key), 256);
});

/** A schema of about n characters, `shares` of which go to each of its parts. */
function mixed(n: number, shares: Readonly<Record<string, number>>): string {
  const all = Object.values(shares).reduce((sum, share) => sum + share, 1);
  const of = (part: string, bytes: number): number => Math.floor((n * shares[part]!) / all / bytes);
  const set = 'k'.repeat(of('setName', 1) || 1);
  const bits = names(of('bits', 8));
  return schemaText({
    labels: { j: ['x', ...names(of('labels', 8))], [set]: ['x'], ...each(names(of('sets', 16)), ['x']) },
    fields: Array.from({ length: 1 + of('fields', 64) }, (_, i) => ({
      name: `f${i}`,
      labels: set,
      ...(i > 1 ? { rel: `f${i - 1}` } : { bits }),
    })),
    mapping: {
      joints: {
        ...each(names(of('joints', 20)), { terms: [] }),
        a: { terms: times(of('terms', 16), ['x', 1]) },
      },
      thresholds: { [set]: each(names(of('thresholds', 20)), { low: 0 }) },
    },
    more: times(of('more', 3), []),
  });
}

test('no mixture of parts is worse', () => {
  const share = fc.constantFrom(0, 0, 1, 2, 8);
  const parts = ['setName', 'bits', 'labels', 'sets', 'fields', 'joints', 'terms', 'thresholds', 'more'];
  const shares = fc.record(Object.fromEntries(parts.map((part) => [part, share])));
  fc.assert(
    fc.property(shares, (given) => {
      expectNoFasterThanInput(
        (n) => mixed(n, given),
        (text) => parseSchema(text),
        12_000,
      );
    }),
    { numRuns: 30 },
  );
});
