import { createHash } from 'node:crypto';
import { readdirSync, readFileSync } from 'node:fs';
import fc from 'fast-check';
import { describe, expect, test, vi } from 'vitest';
import {
  Decoder,
  decodeKeyPage,
  decodeSegment,
  Encoder,
  encodeKeyPage,
  encodeSegment,
  type KeyPage,
  type KeyPose,
  pickPose,
  SegmentError,
} from '../src/index.ts';
import { aStream } from './arbitrary.ts';
import { expectNoFasterThanInput } from './cost.ts';
import { bytesOf, FROM_MS, type Parts, recorded } from './recordings.ts';
import { bytes, hex, load } from './vectors.ts';

vi.setConfig({ testTimeout: 60_000 });

interface Vectors {
  readonly good: readonly {
    readonly name: string;
    readonly encode?: true;
    readonly bytes: Parts;
    readonly page: object;
  }[];
  readonly bad: readonly { readonly says: string; readonly bytes: Parts }[];
  readonly picks: readonly {
    readonly from_ms: number;
    readonly segments: readonly string[];
    readonly pages: readonly { readonly every: number; readonly page: string }[];
  }[];
}

const { good, bad, picks } = load<Vectors>('vectors/key_pages.json');
const VECTORS = new URL('../../vectors/', import.meta.url);
const KEY = decodeKeyPage(bytesOf(good[0]!.bytes)).poses[0]!;

/** As the vectors have it. */
function shown({ robot, view, fromMs, poses }: KeyPage): object {
  return {
    robot,
    view,
    from_ms: fromMs,
    poses: poses.map(({ atMs, runId, lateUs, copies, frame, ...rest }) => ({
      ...rest,
      at_ms: atMs,
      run_id: runId,
      late_us: lateUs,
      copies: copies.map(hex),
      frame: hex(frame),
    })),
  };
}

function refusal(act: () => unknown): string {
  try {
    act();
  } catch (error) {
    if (error instanceof SegmentError) return error.message;
    throw error;
  }
  throw new Error('nothing wrong was found');
}

/** A KEY over and over. */
function keys(count: number, frame = KEY.frame, everyMs = 1): KeyPose[] {
  return Array.from({ length: count }, (_, index) => ({
    ...KEY,
    index,
    frame,
    atMs: FROM_MS + everyMs * index,
  }));
}

const HUBO = { robot: 'hubo', view: 'public', fromMs: FROM_MS };

describe('key_pages.json', () => {
  test.each(good)('$name', ({ bytes: parts, page, encode }) => {
    const data = bytesOf(parts);
    const found = decodeKeyPage(data);
    expect(shown(found)).toEqual(page);
    const again = encodeKeyPage(found, found.poses);
    if (encode) expect(hex(again)).toBe(hex(data));
    expect(shown(decodeKeyPage(again))).toEqual(page);
  });

  test.each(bad)('$says', ({ bytes: parts, says }) => {
    expect(refusal(() => decodeKeyPage(bytesOf(parts)))).toBe(says);
  });

  test.each(picks)('pages of segments', ({ from_ms: fromMs, segments, pages }) => {
    const raw = segments.map(bytes);
    for (const { every, page } of pages) {
      for (const given of [raw, raw.toReversed(), raw.map(decodeSegment)])
        expect(hex(encodeKeyPage({ ...HUBO, fromMs }, given, every))).toBe(page);
    }
  });
});

test('a page that version 1 wrote has the poses of the segments that it wrote', () => {
  const data = readFileSync(new URL('key_pages/demo.pck', VECTORS));
  expect(createHash('sha256').update(data).digest('hex')).toBe(
    '6b2afd62789cb2cc95a94ad4822fa6e27dd43d3cc4902e64bf6b20da183a9cfd',
  );
  const segments = readdirSync(new URL('segments/', VECTORS))
    .filter((name) => name.endsWith('.pcs'))
    .map((name) => pickPose(readFileSync(new URL(`segments/${name}`, VECTORS))))
    .filter((pose) => pose !== null)
    .sort((a, b) => a.atMs - b.atMs);
  const { poses, ...page } = decodeKeyPage(data);
  expect(shown({ ...page, poses })).toEqual(shown({ ...page, poses: segments }));
  expect(poses.length).toBe(4);
});

test('every pose is the first one of its segment, and decodes alone', () => {
  fc.assert(
    fc.property(aStream(), fc.array(fc.boolean(), { minLength: 14, maxLength: 14 }), (stream, cuts) => {
      const encoder = new Encoder(stream.schema);
      const frames = stream.states.map((codes, i) => encoder.encode(codes, i, i / 10, i / 10));
      const segments = recorded(frames, cuts);
      const data = encodeKeyPage(HUBO, segments.map(encodeSegment));
      const found = decodeKeyPage(data);
      expect(found.poses.map((pose) => pose.index)).toEqual(segments.map(({ start }) => start.index));
      for (const [i, pose] of found.poses.entries()) {
        expect(pickPose(segments[i]!)).toEqual(pose);
        const decoder = new Decoder();
        decoder.addSchema(stream.schema.text);
        for (const copy of pose.copies) decoder.decode(copy);
        expect([...decoder.decode(pose.frame).codes]).toEqual(stream.states[pose.seq]);
      }
      expect(hex(encodeKeyPage(found, found.poses))).toBe(hex(data));
    }),
  );
});

test('no part of a page is one, nor one with another byte', () => {
  const data = encodeKeyPage(HUBO, keys(2));
  for (let at = 0; at < data.length; at++) {
    refusal(() => decodeKeyPage(data.subarray(0, at)));
    const hurt = data.slice();
    hurt[at]! ^= 1;
    refusal(() => decodeKeyPage(hurt));
  }
});

test('what can not be in a page is refused', () => {
  const { copies, ...rest } = KEY;
  const wrong: [Parameters<typeof encodeKeyPage>, string][] = [
    [[HUBO, [bytes('00')]], 'byte 0: no segment'],
    [[{ ...HUBO, view: 'lab' }, picks[0]!.segments.map(bytes)], 'segment: of hubo/public, not hubo/lab'],
    [[HUBO, [KEY, KEY]], 'segment: take 0000000000000007, index 0: given twice'],
    [[HUBO, keys(2, KEY.frame, 1_200_000)], 'moment: 1200000, 0 to 1199999 allowed'],
    [[HUBO, [{ ...rest, copies: [KEY.frame] }]], 'frame: a KEY behind copies'],
    [[HUBO, [{ ...rest, copies, seq: 1 }]], 'frame: its number is not 1'],
    [
      [HUBO, [{ ...rest, copies, runId: '0'.repeat(16) }]],
      'take: take and run are u64, and the run is not 0',
    ],
    [[HUBO, [], 0], 'every: 0, at least 1 allowed'],
  ];
  for (const [given, says] of wrong) expect(refusal(() => encodeKeyPage(...given))).toBe(says);
});

test('more than fits is thinned evenly', () => {
  const large = new Uint8Array(60_000);
  large.set(KEY.frame);
  const indexes = decodeKeyPage(encodeKeyPage(HUBO, keys(40, large))).poses.map((pose) => pose.index);
  expect(indexes).toEqual([0, 4, 8, 12, 16, 20, 24, 28, 32, 36]);
  expect(decodeKeyPage(encodeKeyPage(HUBO, keys(4096))).poses.length).toBe(4096);
  expect(decodeKeyPage(encodeKeyPage(HUBO, keys(4097))).poses.length).toBe(2049);
});

test('reading costs no more than in proportion to the length', () => {
  expectNoFasterThanInput((n) => encodeKeyPage(HUBO, keys(n)), decodeKeyPage, 200);
});
