import { expect, test } from 'vitest';
import { MISSING, Schema, SchemaError } from '../src/index.ts';
import { load, type Schemas } from './vectors.ts';

const vectors = load<Schemas>('vectors/schemas.json');

test.each(vectors.bad)('refuses by place: $where', ({ where, text }) => {
  let said = '';
  try {
    Schema.parse(text);
  } catch (e) {
    expect(e).toBeInstanceOf(SchemaError);
    said = (e as Error).message;
  }
  expect(said.startsWith(`${where}: `), said).toBe(true);
});

test('id and text are of the exact text', () => {
  const schema = Schema.parse(vectors.mapping.text);
  expect(schema.id).toBe(vectors.id);
  expect(schema.text).toBe(vectors.mapping.text);
});

test('hostile names are names', () => {
  const schema = Schema.parse(
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
  const schema = Schema.parse(
    '{"type":"schema","v":1,"robot":"r","labels":{"x":["x"]},"fields":[{"name":"f","labels":"x","bits":["homed","jam"]}]}',
  );
  const flags = schema.field('f')!;
  expect(flags.bitsSet(0)).toEqual([]);
  expect(flags.bitsSet(2)).toEqual(['jam']);
  expect(flags.bitsSet(1 + (1 << 27))).toEqual(['homed', 'bit 27']);
  expect(flags.bitsSet(MISSING)).toEqual([]);
});
