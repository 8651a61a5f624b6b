import fc from 'fast-check';
import { describe, expect, test } from 'vitest';
import {
  BadFrame,
  BaseUnknown,
  Decoder,
  Encoder,
  FrameError,
  frameId,
  MISSING,
  parseSchema,
  type Schema,
} from '../src/index.ts';
import { aStream, someCodes, someSchema } from './arbitrary.ts';
import { bytes, FRAME_FILES, type Step } from './vectors.ts';

function verdict(decoder: Decoder, frame: Uint8Array): Partial<Step> {
  try {
    const got = decoder.decode(frame);
    return { is: 'state', seq: got.seq, t: got.tS, codes: Array.from(got.codes) };
  } catch (e) {
    if (e instanceof BaseUnknown) return { is: 'unknown' };
    if (e instanceof BadFrame) return { is: 'bad', says: e.message };
    throw e;
  }
}

function decoderOf(...schemas: readonly Schema[]): Decoder {
  const decoder = new Decoder();
  for (const schema of schemas) decoder.addSchema(schema.text);
  return decoder;
}

describe.each(FRAME_FILES)('$name.json', ({ schemas, cases }) => {
  test.each(cases)('$name', ({ steps }) => {
    const decoder = new Decoder();
    steps.forEach(({ schema, frame, note, from: _, ...step }, i) => {
      const expected = step.is === 'bad' ? { says: expect.any(String), ...step } : step;
      if (schema !== undefined) decoder.addSchema(schemas[schema]!);
      else expect(verdict(decoder, bytes(frame!)), `step ${i} ${note ?? ''}`).toEqual(expected);
    });
  });
});

test('decode after encode is identity over the whole code range', () => {
  fc.assert(
    fc.property(aStream(), ({ schema, states }) => {
      const encoder = new Encoder(schema);
      const decoder = decoderOf(schema);
      states.forEach((codes, i) => {
        const got = decoder.decode(encoder.encode(codes, i, i / 10, i / 10));
        expect(Array.from(got.codes)).toEqual(codes);
        expect(got.seq).toBe(i);
        expect(got.tS).toBeCloseTo(i / 10, 3);
      });
    }),
    { numRuns: 150 },
  );
});

test('any frames that come with their KEYs decode', () => {
  fc.assert(
    fc.property(aStream(), fc.infiniteStream(fc.boolean()), ({ schema, states }, coin) => {
      const encoder = new Encoder(schema, 1);
      const decoder = decoderOf(schema);
      let newest = '';
      for (const [i, codes] of states.entries()) {
        const frame = encoder.encode(codes, i, i / 10, i / 10);
        const isKey = frame[0] === 0x13;
        if (!isKey && coin.next().value) continue;
        newest = decoder.decode(frame).codes.join();
        expect(newest).toBe(codes.join());
      }
    }),
    { numRuns: 150 },
  );
});

test('damaged bytes are refused or read, and what is refused changes nothing', () => {
  const damage = fc.record({
    cut: fc.nat({ max: 60 }),
    flip: fc.option(fc.nat({ max: 8 * 60 })),
    noise: fc.option(fc.uint8Array({ maxLength: 80 })),
  });
  fc.assert(
    fc.property(
      aStream(),
      fc.array(damage, { minLength: 1, maxLength: 8 }),
      ({ schema, states }, damages) => {
        const encoder = new Encoder(schema);
        const decoder = decoderOf(schema);
        const key = encoder.encode(states[0]!, 1, 0, 0);
        const plain = encoder.encode(states.at(-1)!, 2, 0, 0);
        decoder.decode(key);
        for (const { cut, flip, noise } of damages) {
          const hurt = noise ?? plain.slice(0, Math.max(0, plain.length - cut));
          if (flip !== null && hurt.length > 5)
            hurt[5 + ((flip >> 3) % (hurt.length - 5))]! ^= 1 << (flip & 7);
          let refused = false;
          try {
            decoder.decode(hurt);
          } catch (e) {
            expect(e).toBeInstanceOf(FrameError);
            refused = true;
          }
          if (refused) expect(Array.from(decoder.decode(plain).codes)).toEqual(states.at(-1));
        }
      },
    ),
    { numRuns: 300 },
  );
});

test('a frame longer than its schema can fill is bad before its body is read', () => {
  const schema = parseSchema(FRAME_FILES[0]!.schemas.one!);
  const decoder = decoderOf(schema);
  const key = new Encoder(schema).encode([1], 1, 0, 0);
  const padded = (frame: Uint8Array, size: number): Uint8Array => {
    const longer = new Uint8Array(size);
    longer.set(frame);
    return longer;
  };
  expect(() => decoder.decode(padded(key, 27))).toThrow('frame of 27 bytes, 26 allowed by its schema');
  decoder.decode(key);
  const plain = new Encoder(schema);
  plain.encode([1], 1, 0, 0);
  const next = plain.encode([2], 2, 0, 0);
  const long = padded(next, 65_536);
  expect(() => decoder.decode(long)).toThrow('frame of 65536 bytes, 18 allowed by its schema');
});

test('the codes handed out are the caller’s: writing into them spoils no base', () => {
  const schema = parseSchema(FRAME_FILES[0]!.schemas.one!);
  const encoder = new Encoder(schema);
  const decoder = decoderOf(schema);
  for (let i = 0; i < 9; i++) {
    const got = decoder.decode(encoder.encode([i], i, i, 0));
    expect(Array.from(got.codes)).toEqual([i]);
    got.codes.fill(MISSING);
  }
});

test('the same KEY again changes nothing, and a new one retires it', () => {
  const schema = parseSchema(FRAME_FILES[0]!.schemas.one!);
  const encoder = new Encoder(schema);
  const decoder = decoderOf(schema);
  const [key, plain] = [0, 1].map((i) => encoder.encode([i], i, i / 10, 0));
  for (const frame of [key!, key!]) decoder.decode(frame);
  expect(Array.from(decoder.decode(plain!).codes)).toEqual([1]);
  decoder.decode(encoder.encode([9], 4, 0.4, 0, true));
  expect(() => decoder.decode(plain!)).toThrow(BaseUnknown);
});

test('a REF is refused by its name and is no base', () => {
  const schema = parseSchema(FRAME_FILES[0]!.schemas.one!);
  const encoder = new Encoder(schema);
  const decoder = decoderOf(schema);
  const [key, plain] = [0, 1].map((i) => encoder.encode([i], i, i / 10, 0));
  decoder.decode(key!);
  const ref = plain!.slice();
  ref[0] = 0x12;
  expect(() => decoder.decode(ref)).toThrow(new BadFrame('REF frames are reserved'));
  const named = plain!.slice();
  new DataView(named.buffer).setUint32(1, frameId(ref), true);
  expect(() => decoder.decode(named)).toThrow(BaseUnknown);
  expect(Array.from(decoder.decode(plain!).codes)).toEqual([1]);
});

test('a fifth schema pushes out the oldest, and the base in use stays', () => {
  const schemas = ['a', 'b', 'c', 'd', 'e'].map((robot) =>
    parseSchema(
      JSON.stringify({
        type: 'schema',
        v: 1,
        robot,
        labels: { x: ['x'] },
        fields: [{ name: 'x', labels: 'x' }],
      }),
    ),
  );
  const encoder = new Encoder(schemas[0]!);
  const key = encoder.encode([1], 1, 0, 0);
  const decoder = decoderOf(...schemas.slice(0, 4));
  decoder.decode(key);
  decoder.addSchema(schemas[4]!.text);
  expect(() => decoder.decode(key)).toThrow(BaseUnknown);
  expect(Array.from(decoder.decode(encoder.encode([2], 2, 0, 0)).codes)).toEqual([2]);
});

test('values have units and null, and frames of one field and many agree', () => {
  fc.assert(
    fc.property(
      someSchema().chain((s) => fc.tuple(fc.constant(s), someCodes(s.size))),
      ([schema, codes]) => {
        const frame = decoderOf(schema).decode(new Encoder(schema).encode(codes, 0, 0, 0));
        const all = schema.fields.flatMap((f) => frame.values(f.name));
        codes.forEach((code, i) => {
          const field = schema.fields.find((f) => i < f.start + f.size)!;
          expect(all[i]).toBe(code === MISSING ? null : code * field.scale);
        });
      },
    ),
    { numRuns: 50 },
  );
});
