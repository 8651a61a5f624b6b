import { constants, gunzipSync, gzipSync } from 'node:zlib';
import { afterEach, describe, expect, test, vi } from 'vitest';
import {
  checkSegment,
  decodeRecording,
  encodeRecording,
  eventOf,
  keyPagePath,
  modelPath,
  type PastRecording,
  type RecordedSegment,
  RecordingError,
  SegmentError,
  type SegmentStart,
  segmentPath,
  unpackSegment,
} from '../src/index.ts';
import { expectNoFasterThanInput } from './cost.ts';
import { bytes, load } from './vectors.ts';

interface Vectors {
  readonly good: readonly {
    readonly name: string;
    readonly encode?: true;
    readonly text: string;
    readonly says: object;
  }[];
  readonly bad: readonly {
    readonly says: string;
    readonly text: readonly (string | readonly [string, number])[];
  }[];
  readonly packed: readonly { readonly says: string; readonly bytes: readonly [string, number][] }[];
}

const { good, bad, packed } = load<Vectors>('vectors/recordings.json');
const UTF8 = new TextEncoder();
const SOME = decodeRecording(UTF8.encode(good[0]!.text));

/** As the vectors have it. */
function shown(found: PastRecording): object {
  const { fromMs, toMs, notes, schemas, segments, ...rest } = found;
  return {
    ...rest,
    from_ms: fromMs,
    to_ms: toMs,
    notes: notes.map(({ atMs, text }) => [atMs, text]),
    schemas: [...schemas],
    segments: segments.map((one) => {
      const { runId, fromMs, toMs, firstSeq, lastSeq, words, events, ...others } = one;
      return {
        ...others,
        path: segmentPath(one),
        key_page: keyPagePath(fromMs),
        run_id: runId,
        from_ms: fromMs,
        to_ms: toMs,
        first_seq: firstSeq,
        last_seq: lastSeq,
        words: words.map(({ atMs, word }) => [atMs, word]),
        events: events.map(({ atMs, event }) => [atMs, event]),
      };
    }),
  };
}

function refusal(act: () => unknown): string {
  try {
    act();
  } catch (error) {
    if (error instanceof RecordingError) return error.message;
    throw error;
  }
  throw new Error('nothing wrong was found');
}

function joined(parts: Vectors['bad'][number]['text']): Uint8Array {
  return UTF8.encode(
    parts.map((part) => (typeof part === 'string' ? part : part[0].repeat(part[1]))).join(''),
  );
}

function many(count: number): PastRecording {
  const segment = SOME.segments[0]!;
  const segments = Array.from({ length: count }, (_, index): RecordedSegment => {
    const fromMs = SOME.fromMs + 4000 * index;
    const events = [{ atMs: fromMs, event: { n: index } }];
    return {
      ...segment,
      index,
      fromMs,
      toMs: fromMs + 4000,
      words: [{ atMs: fromMs, word: 'online' }],
      events,
    };
  });
  return { ...SOME, toMs: SOME.fromMs + 4000 * count + 1000, segments };
}

describe('recordings.json', () => {
  test.each(good)('$name', ({ text, says, encode }) => {
    const found = decodeRecording(UTF8.encode(text));
    expect(shown(found)).toEqual(says);
    const again = encodeRecording(found);
    expect(decodeRecording(again)).toEqual(found);
    if (encode) expect(new TextDecoder().decode(again)).toBe(text);
  });

  test.each(bad)('$says', ({ text, says }) => {
    expect(refusal(() => decodeRecording(joined(text)))).toBe(says);
  });
});

test('what could not be read again is not written', () => {
  const wrong: [PastRecording, string][] = [
    [{ ...SOME, title: '' }, 'title: must be a text of 1 to 500 characters without control characters'],
    [{ ...SOME, segments: [] }, 'segments: there are none'],
    [{ ...SOME, models: [] }, `segments[0]: model: ${'ab'.repeat(32)} is not in the list`],
    [{ ...SOME, author: '\ud800' }, 'recording: not JSON'],
  ];
  for (const [given, says] of wrong) expect(refusal(() => encodeRecording(given))).toBe(says);
});

test('bytes that are no text', () => {
  expect(refusal(() => decodeRecording(Uint8Array.of(0xff)))).toBe('recording: not JSON');
});

test('another segment than its place says is refused', () => {
  const { robot, view } = SOME;
  const expected = SOME.segments[1]!;
  const start: SegmentStart = {
    ...{ robot, view, take: expected.take, index: expected.index, runId: expected.runId },
    ...{ fromMs: expected.fromMs, schema: null, model: null, missing: 0, numbering: '', eventN: 0 },
    ...{ word: 'online', info: new Map<string, string>(), openFaults: [] },
  };
  checkSegment(SOME, expected, { start });
  for (const other of [{ robot: 'baxter' }, { view: 'lab' }, { take: '0'.repeat(16) }, { index: 2 }]) {
    const swapped = { ...start, ...other };
    expect(refusal(() => checkSegment(SOME, expected, { start: swapped }))).toBe(
      `segments/${expected.take}/0.segment: is of ${swapped.robot}/${swapped.view}, take ${swapped.take}, index ${swapped.index}`,
    );
  }
});

test('events are read as live, and those of later are none', () => {
  const [first] = SOME.segments[0]!.events;
  expect(eventOf(first!)).toMatchObject({ type: 'event', n: 7, level: 'fault', at: null });
  expect(eventOf({ atMs: 0, event: { type: 'event' } })).toBeNull();
});

/** Unpacks as Chromium does: all of a chunk at once, whether or not anybody reads what comes out. */
class EagerGunzip extends TransformStream<Uint8Array, Uint8Array> {
  static unpackedBytes = 0;

  constructor() {
    const chunks: Uint8Array[] = [];
    let given = 0;
    super({
      transform(chunk, out) {
        chunks.push(chunk);
        const whole = gunzipSync(Buffer.concat(chunks), { finishFlush: constants.Z_SYNC_FLUSH });
        EagerGunzip.unpackedBytes += whole.length - given;
        out.enqueue(new Uint8Array(whole.subarray(given)));
        given = whole.length;
      },
    });
  }
}

afterEach(() => void vi.unstubAllGlobals());

test.each(packed)('a packed segment: $says', async ({ bytes: parts, says }) => {
  const data = bytes(parts.map(([digits, times]) => digits.repeat(times)).join(''));
  const answer = await unpackSegment(data.slice()).then(
    (segment) => `${segment.length} bytes`,
    (error: unknown) => (error instanceof SegmentError ? error.message : String(error)),
  );
  expect(answer).toBe(says);
});

test('a packed segment is unpacked only a little further than a segment may go', async () => {
  vi.stubGlobal('DecompressionStream', EagerGunzip);
  EagerGunzip.unpackedBytes = 0;
  const bomb = new Uint8Array(gzipSync(new Uint8Array(64 << 20)));
  await expect(unpackSegment(bomb)).rejects.toThrow('gzip: over 2097174 bytes');
  expect(EagerGunzip.unpackedBytes).toBeLessThan(16 << 20);
  const segment = new Uint8Array(2_000_000).fill(7);
  const unpacked = await unpackSegment(new Uint8Array(gzipSync(segment)));
  expect(Buffer.compare(unpacked, segment)).toBe(0);
});

test('where files lie', () => {
  expect(segmentPath({ take: '00000000000000ff', index: 7 })).toBe('segments/00000000000000ff/7.segment');
  expect(keyPagePath(SOME.fromMs)).toBe('keys/2026-11-22T14-20Z.keys');
  expect(modelPath('ab', 'manifest.json')).toBe('models/ab/manifest.json');
});

test('reading costs no more than in proportion to the length', () => {
  expectNoFasterThanInput((n) => encodeRecording(many(n)), decodeRecording, 200);
});
