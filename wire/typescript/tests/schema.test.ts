import { expect, test } from 'vitest';
import { MISSING, parseSchema, revived, SchemaError } from '../src/index.ts';
import { load, type Schemas } from './vectors.ts';

const vectors = load<Schemas>('vectors/schemas.json');

test.each(vectors.bad)('refuses by place: $where', ({ where, text }) => {
  let message = '';
  try {
    parseSchema(text);
  } catch (e) {
    expect(e).toBeInstanceOf(SchemaError);
    message = (e as Error).message;
  }
  expect(message.startsWith(`${where}: `), message).toBe(true);
});

test.each(vectors.good)('reads alike: $why', ({ text, fields }) => {
  const found = parseSchema(text).fields;
  expect(found.map(({ name, labels, scale }) => ({ name, labels, scale }))).toEqual(fields);
});

const FIELD = { name: 'a', labels: 'j' };
const DOC = { type: 'schema', v: 1, robot: 'r', labels: { j: ['x'] }, fields: [FIELD] };

test('a label set has no more names than a schema has channels', () => {
  const k = Array.from({ length: 4097 }, (_, i) => String(i));
  const text = JSON.stringify({ ...DOC, labels: { j: ['x'], k } });
  expect(() => parseSchema(text)).toThrow('labels.k: more than 4096 names');
});

test('a text past 256 KiB is refused before it is read, also where its characters take more bytes', () => {
  for (const text of [' '.repeat(262_145), 'é'.repeat(131_073), `"${'🦾'.repeat(65_536)}"`])
    expect(() => parseSchema(text)).toThrow('schema: longer than 262144 bytes');
  expect(parseSchema(JSON.stringify(DOC).padEnd(262_144)).size).toBe(1);
});

test('a text that is not Unicode is refused', () => {
  expect(() => parseSchema('{"a":"\ud800","a":1}')).toThrow('schema: not JSON: not Unicode');
});

test.each([
  { ...DOC, labels: { j: ['\u202e\u200b'.repeat(100), '\u202e\u200b'.repeat(100)] } },
  { ...DOC, labels: { ['\u2028'.repeat(100_000)]: [] } },
  { ...DOC, labels: { j: ['k'.repeat(200_000)] } },
  { ...DOC, labels: { ['\u202e'.repeat(200)]: [''] } },
  { ...DOC, fields: [{ ...FIELD, labels: '\u3164\u2800\ufe0f\u00a0' }] },
  { ...DOC, mapping: { units: { ['u'.repeat(200)]: { ['\n'.repeat(50_000)]: 'mm' } } } },
  '{"a":\n\u202e}',
])('quotes in one short line with nothing unseen', (document) => {
  let message = '';
  try {
    parseSchema(typeof document === 'string' ? document : JSON.stringify(document));
  } catch (e) {
    message = (e as Error).message;
  }
  expect(message).not.toMatch(/\p{C}|\p{Zl}|\p{Zp}|\u00a0|\u2800|\u3164|\ufe0f/u);
  expect(message).not.toBe('');
  expect(message.length).toBeLessThan(1_500);
});

test('id and text are of the exact text', () => {
  const schema = parseSchema(vectors.mapping.text);
  expect(schema.id).toBe(vectors.id);
  expect(schema.text).toBe(vectors.mapping.text);
});

test('hostile names are names', () => {
  const schema = parseSchema(
    '{"type":"schema","v":1,"robot":"__proto__","labels":{"__proto__":["constructor","__proto__"]},' +
      '"fields":[{"name":"__proto__","labels":"__proto__"},{"name":"constructor","labels":"__proto__"}],' +
      '"mapping":{"names":{"__proto__":"a"},"severity":{"__proto__":{"constructor":"state"}}}}',
  );
  expect(schema.fields.map((f) => f.name)).toEqual(['__proto__', 'constructor']);
  expect(schema.field('__proto__')?.labels).toEqual(['constructor', '__proto__']);
  expect(schema.field('toString')).toBeNull();
  expect(schema.mapping.names.get('__proto__')).toBe('a');
  expect(schema.mapping.severity('__proto__', 'constructor')).toBe('state');
  expect(schema.mapping.severity('toString', 'valueOf')).toBe('fault');
  expect(Object.hasOwn(Object.prototype, 'names')).toBe(false);
});

test('bits have names', () => {
  const schema = parseSchema(
    '{"type":"schema","v":1,"robot":"r","labels":{"x":["x"]},"fields":[{"name":"f","labels":"x","bits":["homed","jam"]}]}',
  );
  const flags = schema.field('f')!;
  expect(flags.bitsSet(0)).toEqual([]);
  expect(flags.bitsSet(2)).toEqual(['jam']);
  expect(flags.bitsSet(1 + (1 << 27))).toEqual(['homed', 'bit 27']);
  expect(flags.bitsSet(MISSING)).toEqual([]);
});

test('a schema that has come through postMessage gets its classes back', () => {
  for (const { text } of vectors.good) {
    const read = parseSchema(text);
    const back = revived(structuredClone(read));
    expect(back).toEqual(read);
    expect([back.size, back.keyBytesMax]).toEqual([read.size, read.keyBytesMax]);
    const [field] = back.fields;
    expect(back.field(field?.name ?? '')).toBe(field);
    expect(field?.bitsSet(0)).toEqual([]);
    expect(back.mapping.tolerance('nobody')).toBeNull();
  }
});
