import fc from 'fast-check';
import { expect, test } from 'vitest';
import {
  Decoder,
  Encoder,
  type MergedFrame,
  mergeSegments,
  parseSchema,
  SegmentError,
} from '../src/index.ts';
import { aStream } from './arbitrary.ts';
import { FROM_MS, recorded } from './recordings.ts';
import { hex } from './vectors.ts';

const ONE = parseSchema(
  '{"type":"schema","v":1,"robot":"one","labels":{"x":["x"]},"fields":[{"name":"x","labels":"x"}]}',
);
const [A, B] = ['000000000000000a', '000000000000000b'];

/** Frames of one channel, whose code is their number. */
function frames(count: number, keyEveryS = 4): Uint8Array[] {
  const encoder = new Encoder(ONE, keyEveryS);
  return Array.from({ length: count }, (_, i) => encoder.encode([i], i, i / 30, i / 30));
}

function decoded(merged: readonly MergedFrame[], schema = ONE): number[][] {
  const decoder = new Decoder();
  decoder.addSchema(schema.text);
  return merged.map(({ copies, frame }) => {
    for (const copy of copies) decoder.decode(copy);
    return [...decoder.decode(frame).codes];
  });
}

test('a frame that two takes have counts once, as in the segment that begins first', () => {
  const sent = frames(12, 0.1);
  const first = recorded(sent, [], { take: A, hears: [0, 8] });
  const second = recorded(sent, [], { take: B, hears: [4, 12], firstMs: FROM_MS - 5 });
  for (const given of [
    [...first, ...second],
    [...second, ...first],
  ]) {
    const { frames: merged, gaps } = mergeSegments(given);
    expect(merged.map(({ seq }) => seq)).toEqual([...sent.keys()]);
    expect(merged.map(({ frame }) => hex(frame))).toEqual(sent.map(hex));
    const times = sent.map((_, i) => Math.round(i * 33.333 - (i < 8 ? 0 : 5)));
    expect(merged.map(({ atMs }) => Math.round(atMs - FROM_MS))).toEqual(times);
    expect(merged.flatMap(({ copies }) => copies)).toEqual([]);
    expect(decoded(merged)).toEqual(sent.map((_, i) => [i]));
    expect(gaps).toEqual([]);
  }
});

test('what no take has is a gap with its numbers and times', () => {
  const sent = frames(20);
  const first = recorded(sent, [], { take: A, hears: [0, 14], misses: new Set([3, 4, 5, 9]) });
  const second = recorded(sent, [], { take: B, hears: [2, 20], misses: new Set([4, 5, 15, 19]) });
  const { frames: merged, gaps } = mergeSegments([...first, ...second]);
  expect(merged.map(({ seq }) => seq)).toEqual(
    [...sent.keys()].filter((seq) => ![4, 5, 15, 19].includes(seq)),
  );
  const at = (seq: number): number => FROM_MS + (seq * 33_333) / 1000;
  expect(gaps.map(({ runId, firstSeq, count }) => [runId, firstSeq, count])).toEqual([
    ['0000000000000009', 4, 2],
    ['0000000000000009', 15, 1],
  ]);
  for (const [i, [before, behind]] of [
    [3, 6],
    [14, 16],
  ].entries()) {
    expect(gaps[i]!.fromMs).toBeCloseTo(at(before!), 2);
    expect(gaps[i]!.toMs).toBeCloseTo(at(behind!), 2);
  }
});

test('a base that is in no segment comes as a copy, once', () => {
  const sent = frames(20);
  const { frames: merged } = mergeSegments(recorded(sent, [], { hears: [12, 20] }));
  expect(merged.map(({ copies }) => copies.map(hex))).toEqual([[hex(sent[0]!)], ...new Array(7).fill([])]);
  expect(decoded(merged)).toEqual(sent.slice(12).map((_, i) => [12 + i]));
});

test('runs stand one after the other, as they began', () => {
  const sent = frames(4);
  const later = recorded(sent, [], { take: A, runId: A, firstMs: FROM_MS + 60_000 });
  const earlier = recorded(sent, [], { take: B, runId: B });
  const { frames: merged, gaps } = mergeSegments([...later, ...earlier]);
  expect(merged.map(({ runId, seq }) => [runId, seq])).toEqual(
    [B, A].flatMap((runId) => [0, 1, 2, 3].map((seq) => [runId, seq])),
  );
  expect(gaps).toEqual([]);
  expect(mergeSegments([])).toEqual({ frames: [], gaps: [] });
});

test('numbers go round', () => {
  const encoder = new Encoder(ONE);
  const sent = [-2, -1, 1, 2].map((n) =>
    encoder.encode([n], (n + 2 ** 32) % 2 ** 32, n / 30 + 1, n / 30 + 1),
  );
  const [segment] = recorded(sent, []);
  const records = segment!.records.map((record, i) => ({
    ...record,
    seq: [2 ** 32 - 2, 2 ** 32 - 1, 1, 2][i]!,
  }));
  const { frames: merged, gaps } = mergeSegments([{ ...segment!, records }]);
  expect(merged.map(({ seq }) => seq)).toEqual([2 ** 32 - 2, 2 ** 32 - 1, 1, 2]);
  expect(gaps.map(({ firstSeq, count }) => [firstSeq, count])).toEqual([[0, 1]]);
});

test('segments of several robots or views are refused', () => {
  const [one] = recorded(frames(1), []);
  const other = { ...one!, start: { ...one!.start, view: 'lab' } };
  expect(() => mergeSegments([one!, other])).toThrow(
    new SegmentError('segment: of hubo/lab, not hubo/public'),
  );
});

test('whatever two recorders have between them is read, in order, and decodes', () => {
  const cuts = fc.array(fc.boolean(), { minLength: 14, maxLength: 14 });
  const lost = fc.uniqueArray(fc.nat({ max: 13 }));
  fc.assert(
    fc.property(
      aStream(),
      cuts,
      cuts,
      lost,
      lost,
      fc.integer({ min: -50, max: 50 }),
      fc.nat({ max: 5 }),
      (stream, cutsA, cutsB, lostA, lostB, apartMs, from) => {
        const encoder = new Encoder(stream.schema, 0.4);
        const sent = stream.states.map((codes, i) => encoder.encode(codes, i, i / 10, i / 10));
        const plain = (lost: number[]): Set<number> => new Set(lost.filter((seq) => sent[seq]?.[0] === 0x10));
        const [missedA, missedB] = [plain(lostA), plain(lostB)];
        const all = [
          ...recorded(sent, cutsA, { take: A, misses: missedA, hears: [from, 14] }),
          ...recorded(sent, cutsB, {
            take: B,
            misses: missedB,
            hears: [from, 14],
            firstMs: FROM_MS + apartMs,
          }),
        ];
        const kept = [...sent.keys()].filter((seq) => seq >= from && !(missedA.has(seq) && missedB.has(seq)));
        const { frames: merged, gaps } = mergeSegments(all);
        expect(merged.map(({ seq }) => seq)).toEqual(kept);
        expect(decoded(merged, stream.schema)).toEqual(kept.map((seq) => stream.states[seq]));
        const missing = gaps.reduce((sum, { count }) => sum + count, 0);
        expect(missing).toBe((kept.at(-1) ?? -1) - (kept[0] ?? 0) + 1 - kept.length);
      },
    ),
  );
});
