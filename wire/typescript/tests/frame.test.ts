import { expect, test } from 'vitest';
import { fnv1a32, parseHeader } from '../src/index.ts';
import { bytes } from './vectors.ts';

test('FNV-1a as its authors publish it', () => {
  const of = (text: string): number => fnv1a32(new TextEncoder().encode(text));
  expect([of(''), of('a'), of('foobar')]).toEqual([0x811c9dc5, 0xe40c292c, 0xbf9cf968]);
});

test('headers', () => {
  expect(parseHeader(bytes('13010000800200000000000000000004400000'))).toEqual({
    isKey: true,
    schemaId: 0x80000001,
    seq: 2,
    t: 2.5,
  });
  expect(parseHeader(bytes('10ffffffff0100ffff00'))).toEqual({
    isKey: false,
    baseId: 0xffffffff,
    distance: 1,
    ms: 65535,
  });
  expect(() => parseHeader(bytes('11ffffffff0100ffff00'))).toThrow('tag 0x11');
  expect(() => parseHeader(bytes('12ffffffff0100ffff00'))).toThrow('REF frames are reserved');
});

test('a frame inside a larger buffer is read where it stands', () => {
  const inside = bytes('ffff13010000800200000000000000000004400000').subarray(2);
  expect(parseHeader(inside)).toMatchObject({ isKey: true, seq: 2, t: 2.5 });
});
