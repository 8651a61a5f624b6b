import { createHash } from 'node:crypto';
import { readdirSync, readFileSync } from 'node:fs';
import fc from 'fast-check';
import { describe, expect, test, vi } from 'vitest';
import {
  Decoder,
  decodeSegment,
  Encoder,
  encodeSegment,
  type Segment,
  SegmentError,
  type SegmentRecord,
  type SegmentStart,
} from '../src/index.ts';
import { aStream } from './arbitrary.ts';
import { expectNoFasterThanInput } from './cost.ts';
import { bytesOf, type Parts } from './recordings.ts';
import { hex, load } from './vectors.ts';

vi.setConfig({ testTimeout: 60_000 });

type Shown = readonly [string, ...unknown[]];

interface Vectors {
  readonly good: readonly {
    readonly name: string;
    readonly encode?: true;
    readonly bytes: Parts;
    readonly segment: {
      readonly start: Readonly<Record<string, unknown>>;
      readonly to_ms: number;
      readonly records: readonly Shown[];
    };
  }[];
  readonly bad: readonly { readonly says: string; readonly bytes: Parts }[];
}

const { good, bad } = load<Vectors>('vectors/segments.json');
const KEPT = new URL('../../vectors/segments/', import.meta.url);
const DIGESTS = load<Record<string, { readonly bytes: string; readonly holds: string }>>(
  'vectors/segments/digests.json',
);

/** As the vectors have it. */
function shown({ start, toMs, records }: Segment): object {
  const { runId, fromMs, eventN, openFaults, info, ...rest } = start;
  const named = { ...rest, run_id: runId, from_ms: fromMs, event_n: eventN, open_faults: openFaults };
  return { start: { ...named, info: [...info] }, to_ms: toMs, records: records.map(shownRecord) };
}

function shownRecord(record: SegmentRecord): Shown {
  const { kind, atUs } = record;
  switch (kind) {
    case 'frame':
      return [kind, atUs, record.lateUs, record.seq, hex(record.frame)];
    case 'copy':
      return [kind, atUs, hex(record.frame)];
    case 'event':
      return [kind, atUs, record.text];
    case 'info':
      return [kind, atUs, [...record.info]];
    case 'model':
      return [kind, atUs, record.model];
    case 'word':
      return [kind, atUs, record.word];
  }
}

/** `make_digest` in `wire/python/tests/test_segment_vectors.py`. */
function digestOf({ start, toMs, records }: Segment, decoder: Decoder): string {
  const { robot, view, take, index, runId, fromMs, schema, model, word, missing, numbering, eventN } = start;
  const described = [schema, model, word, missing, numbering, eventN, [...start.info], start.openFaults];
  const lines: unknown[] = [[robot, view, take, index, runId, fromMs, toMs, ...described]];
  for (const record of records) {
    if (record.kind === 'frame') {
      const { seq, tS, codes } = decoder.decode(record.frame);
      const content = [record.lateUs, record.seq, seq, Math.floor(tS * 1000 + 0.5), Array.from(codes)];
      lines.push([record.atUs, record.kind, ...content]);
    } else if (record.kind === 'copy') {
      lines.push([record.atUs, record.kind, decoder.decode(record.frame).seq]);
    } else {
      const [kind, atUs, content] = shownRecord(record);
      lines.push([atUs, kind, content]);
    }
  }
  const text = lines.map((line) => `${JSON.stringify(line)}\n`).join('');
  return createHash('sha256').update(text).digest('hex');
}

function refusal(data: Uint8Array): string {
  try {
    decodeSegment(data);
  } catch (error) {
    if (error instanceof SegmentError) return error.message;
    throw error;
  }
  throw new Error('nothing wrong was found');
}

describe('segments.json', () => {
  test.each(good)('$name', ({ bytes: parts, segment, encode }) => {
    const data = bytesOf(parts);
    const found = decodeSegment(data);
    expect(shown(found)).toEqual(segment);
    if (encode) expect(hex(encodeSegment(found))).toBe(hex(data));
  });

  test.each(bad)('$says', ({ bytes: parts, says }) => {
    expect(refusal(bytesOf(parts))).toBe(says);
  });
});

describe('segments of version 1', () => {
  test('all of them are here', () => {
    expect(readdirSync(KEPT).sort()).toEqual([...Object.keys(DIGESTS), 'digests.json', 'schema.json'].sort());
  });

  test.each(Object.entries(DIGESTS))('%s says what it said', (name, kept) => {
    const data = readFileSync(new URL(name, KEPT));
    expect(createHash('sha256').update(data).digest('hex')).toBe(kept.bytes);
    const decoder = new Decoder();
    decoder.addSchema(readFileSync(new URL('schema.json', KEPT), 'utf8'));
    const segment = decodeSegment(data);
    expect(digestOf(segment, decoder)).toBe(kept.holds);
    expect(hex(encodeSegment(segment))).toBe(hex(data));
  });
});

const u64 = fc.bigInt({ min: 1n, max: (1n << 64n) - 1n }).map((n) => n.toString(16).padStart(16, '0'));
const u32 = fc.nat({ max: 0xffff_ffff });
const hash = fc.uint8Array({ minLength: 32, maxLength: 32 }).map(hex);
const text = fc.string({ unit: 'binary', maxLength: 20 }).filter((s) => !/\p{Cs}/u.test(s));
const info = fc.array(fc.tuple(text, text), { maxLength: 4 }).map((pairs) => new Map(pairs));
const word = fc.constantFrom('online' as const, 'silent' as const, 'offline' as const);
const start: fc.Arbitrary<SegmentStart> = fc.record({
  robot: fc.constantFrom('hubo', '0-'.repeat(31)),
  view: fc.constantFrom('public', 'a'),
  take: u64,
  index: u32,
  runId: u64,
  fromMs: fc.nat({ max: 2 ** 52 }),
  schema: hash,
  model: fc.option(hash),
  word,
  missing: u32,
  numbering: text,
  eventN: fc.nat({ max: Number.MAX_SAFE_INTEGER }),
  info,
  openFaults: fc.array(text, { maxLength: 3 }),
});
const other = fc.oneof(
  text.map((content) => ({ kind: 'event' as const, text: content })),
  info.map((content) => ({ kind: 'info' as const, info: content })),
  fc.option(hash).map((content) => ({ kind: 'model' as const, model: content })),
  word.map((content) => ({ kind: 'word' as const, word: content })),
);

/** The frames of a stream, a copy of the KEY if it does not begin with that, and what falls between. */
const aSegment: fc.Arbitrary<Segment> = fc
  .record({ stream: aStream(), from: fc.nat({ max: 3 }), start, others: fc.array(other, { maxLength: 8 }) })
  .map(({ stream, from, start: begun, others }) => {
    const encoder = new Encoder(stream.schema);
    const frames = stream.states.map((codes, i) => encoder.encode(codes, i, i / 10, i / 10));
    const skipped = frames.slice(0, Math.min(from, frames.length - 1));
    const copies = skipped.slice(0, 1);
    const records: SegmentRecord[] = copies.map((frame) => ({ kind: 'copy', atUs: 5, frame }));
    frames.forEach((frame, seq) => {
      if (seq < skipped.length) return;
      records.push({ kind: 'frame', atUs: 5 + 33_333 * seq, lateUs: seq ** 5, seq, frame });
      const next = others[seq];
      if (next) records.push({ ...next, atUs: 5 + 33_333 * seq });
    });
    return { start: begun, toMs: begun.fromMs + 500, records };
  });

test('decode after encode is identity, and encode after decode', () => {
  fc.assert(
    fc.property(aSegment, (segment) => {
      const data = encodeSegment(segment);
      const found = decodeSegment(data);
      expect(shown(found)).toEqual(shown(segment));
      expect(hex(encodeSegment(found))).toBe(hex(data));
    }),
  );
});

test('no part of a segment is one, nor one with another byte', () => {
  fc.assert(
    fc.property(aSegment, fc.nat(), fc.integer({ min: 1, max: 255 }), (segment, at, flip) => {
      const data = encodeSegment(segment);
      const place = at % data.length;
      refusal(data.subarray(0, place));
      data[place]! ^= flip;
      refusal(data);
    }),
  );
});

test('what could not be read again is not written', () => {
  const data = readFileSync(new URL('key.pcs', KEPT));
  const segment = decodeSegment(data);
  const wrong: [Segment, string][] = [
    [{ ...segment, toMs: segment.start.fromMs - 1 }, 'record: at 412 µs of -1 ms, the one before at 0 µs'],
    [{ ...segment, records: segment.records.slice(1) }, 'frame: its base'],
    [{ ...segment, records: segment.records.toReversed() }, 'frame: its base'],
    [{ ...segment, start: { ...segment.start, schema: null } }, 'header: frames without a schema or run'],
    [{ ...segment, start: { ...segment.start, take: 'C0FFEE' } }, 'take: want 16 hexadecimal digits'],
    [{ ...segment, start: { ...segment.start, index: 0.5 } }, 'index: 0.5, 0 to 4294967295 allowed'],
    [{ ...segment, start: { ...segment.start, numbering: '\ud800' } }, 'numbering: not Unicode'],
  ];
  for (const [one, says] of wrong) {
    let message = '';
    try {
      encodeSegment(one);
    } catch (error) {
      message = (error as SegmentError).message;
    }
    expect(message).toContain(says);
  }
});

test('reading costs no more than in proportion to the length', () => {
  const decoder = (n: number): Uint8Array =>
    encodeSegment({
      ...decodeSegment(readFileSync(new URL('no_frames.pcs', KEPT))),
      records: Array.from({ length: n }, () => ({ kind: 'word', atUs: 0, word: 'silent' })),
    });
  expectNoFasterThanInput(decoder, decodeSegment, 4_000);
});
