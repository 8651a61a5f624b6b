import fc from 'fast-check';
import { expect, it } from 'vitest';
import { lz4Frame } from '../src/past/save/lz4_frame.ts';
import { readLz4Frame } from './lz4_reader.ts';

const same = (data: Uint8Array) => Buffer.compare(readLz4Frame(lz4Frame(data)), data) === 0;

it('comes back as it was: of any bytes, and of such that repeat themselves', () => {
  fc.assert(fc.property(fc.uint8Array({ maxLength: 300 }), same));
  const part = fc.record({
    bytes: fc.uint8Array({ minLength: 1, maxLength: 40 }),
    times: fc.integer({ min: 1, max: 300 }),
  });
  const repeating = fc
    .array(part, { maxLength: 12 })
    .map((parts) =>
      Buffer.concat(parts.flatMap(({ bytes, times }) => new Array<Uint8Array>(times).fill(bytes))),
    );
  fc.assert(fc.property(repeating, same), { numRuns: 300 });
});

it('ends as the format wants it, at every length', () => {
  for (let size = 0; size < 600; size++)
    expect(same(new Uint8Array(size).fill(7)), `${size} bytes`).toBe(true);
});

it('takes more than a block, what is far apart, and what can’t be compressed', () => {
  const large = new Uint8Array((4 << 20) + 70_000);
  let state = 1;
  for (let i = 0; i < large.length; i++) {
    state = (Math.imul(state, 1_103_515_245) + 12_345) >>> 0;
    large[i] = i % 140_000 < 70_000 ? state >>> 24 : i >> 9;
  }
  expect(same(large)).toBe(true);
  const noise = large.subarray(0, 60_000);
  expect(lz4Frame(noise).length).toBe(noise.length + 7 + 4 + 4);
  expect(lz4Frame(new Uint8Array(1e6)).length).toBeLessThan(5000);
});
