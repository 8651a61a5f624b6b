import { describe, expect, test } from 'vitest';
import { Encoder, MISSING, parseSchema } from '../src/index.ts';
import { FRAME_FILES, hex } from './vectors.ts';

const { schemas, cases } = FRAME_FILES[0]!;

describe('the same bytes as the vectors', () => {
  test.each(cases.filter((c) => c.encode))('$name', ({ steps, encode }) => {
    const schema = parseSchema(schemas[encode!.schema]!);
    const encoder = new Encoder(schema, encode!.key_interval_s);
    for (const { from, frame } of steps)
      if (from)
        expect(hex(encoder.encode(from.codes, from.seq, from.t, from.now, from.force_key))).toBe(frame);
  });
});

test('what no frame can carry is refused', () => {
  const encoder = new Encoder(parseSchema(schemas.one!));
  expect(() => encoder.encode([1, 2], 1, 0, 0)).toThrow('2 codes for 1 channels');
  expect(() => encoder.encode([MISSING - 1], 1, 0, 0)).toThrow('past the range');
  expect(() => encoder.encode([Number.NaN], 1, 0, 0)).toThrow('past the range');
  expect(() => encoder.encode([1], -1, 0, 0)).toThrow('no frame can carry');
  expect(() => encoder.encode([1], 1, Number.NaN, 0)).toThrow('no frame can carry');
  expect(() => new Encoder(encoder.schema, 0)).toThrow('key interval');
});

test('key is the newest KEY', () => {
  const encoder = new Encoder(parseSchema(schemas.one!));
  expect(encoder.key).toBeNull();
  const frames = [0, 1, 2].map((i) => encoder.encode([i], i, i / 10, 0));
  expect(frames.map((f) => f[0])).toEqual([0x13, 0x10, 0x10]);
  expect(encoder.key).toEqual(frames[0]);
  const again = encoder.encode([9], 5, 0.5, 0, true);
  expect(encoder.key).toEqual(again);
});
