import { encodeSegment, keyPagePath, type Segment, segmentPath } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { recordedAs } from '../../src/app/pages/recording/recording_words.ts';
import { type IndexError, readIndex } from '../../src/past/recording/recording_index.ts';
import type { RecordingPast } from '../../src/past/recording/recording_past.ts';
import { Rig } from '../rigs/past_player_rig.ts';
import { FROM_MS, fault, range, recorded, sent } from '../rigs/past_recordings.ts';
import { settled } from '../rigs/past_rig.ts';
import { exported, type FilesHere, opened } from '../rigs/recording_rig.ts';

/** Twenty seconds, ten frames a second, in segments of two. */
const FRAMES = sent(200);
const SEGMENTS = recorded(FRAMES, {
  happened: [{ atMs: FROM_MS + 9050, event: fault(1, FROM_MS + 9050, 'jam') }],
});
const TEXT = new TextDecoder();

const rigOf = (files: FilesHere) => {
  const { source, clock } = opened(files);
  return {
    rig: new Rig(
      source,
      recordedAs(source.span, (momentMs) => source.isLostAt(momentMs)),
    ),
    source,
    clock,
    files,
  };
};
const why = (promise: Promise<unknown>) =>
  promise.then(
    () => 'came',
    (error: { why?: string }) => error.why,
  );
const refsOf = (source: RecordingPast) => source.segmentsIn(source.span);
const pathOf = (i: number) => segmentPath({ take: SEGMENTS[i]!.start.take, index: SEGMENTS[i]!.start.index });
const indexOf = (files: FilesHere) =>
  JSON.parse(TEXT.decode(files.files.get('recording.json'))) as Record<string, unknown>;
const reading = (doc: unknown) => {
  try {
    readIndex(new TextEncoder().encode(typeof doc === 'string' ? doc : JSON.stringify(doc)));
    return 'read';
  } catch (error) {
    return `${(error as IndexError).why}: ${(error as IndexError).what}`;
  }
};

describe('a recording', () => {
  it('is known from its index alone: span, time line, marks', () => {
    const { source } = opened(exported(SEGMENTS));
    expect(source.span).toEqual({ fromMs: FROM_MS, toMs: FROM_MS + 19_900 });
    expect(source.timeline).toMatchObject(source.span);
    expect(source.timeline.movement.length).toBe(SEGMENTS.length);
    expect(source.timeline.marks).toEqual([
      { atMs: FROM_MS + 9050, level: 'fault', source: 'LKN', text: 'jam', exact: true },
    ]);
    expect(refsOf(source).map(({ index }) => index)).toEqual(range(0, SEGMENTS.length));
  });

  it('shows its first pose after one segment, and rests there', async () => {
    const { rig, files } = rigOf(exported(SEGMENTS));
    rig.player.openAt(FROM_MS);
    await rig.pass(500);
    expect(files.asked).toEqual([pathOf(0)]);
    expect(rig.sink.seqs).toEqual([0]);
    expect(rig.player.playhead).toMatchObject({ at: 'past', playing: false, note: null, momentMs: FROM_MS });
  });

  it('plays each frame once and in order, rests at its end, and plays again from the beginning', async () => {
    const { rig } = rigOf(exported(SEGMENTS));
    rig.player.openAt(FROM_MS);
    await rig.pass(200);
    rig.player.toggle();
    await rig.pass(23_000);
    expect(rig.sink.seqs).toEqual(range(0, 200));
    expect(rig.player.playhead).toMatchObject({ at: 'past', playing: false, momentMs: FROM_MS + 19_900 });
    rig.player.toggle();
    await rig.pass(1000);
    expect(rig.player.playhead).toMatchObject({ at: 'past', playing: true });
    expect(rig.sink.seqs[0]).toBe(0);
    expect(rig.sink.seqs.length).toBeLessThan(20);
  });

  it('has no present: the end of the line, the key for it and a jump beyond it lead to its end', async () => {
    const { rig } = rigOf(exported(SEGMENTS));
    rig.player.openAt(FROM_MS);
    await rig.pass(200);
    for (const go of [
      () => rig.player.goLive(),
      () => rig.player.skip(60_000),
      () => rig.player.seek(FROM_MS + 99_000),
      () => {
        rig.player.seek(FROM_MS + 99_000, true);
        rig.player.settle();
      },
    ]) {
      rig.player.seek(FROM_MS + 1000);
      await rig.pass(200);
      go();
      await rig.pass(500);
      expect(rig.player.playhead).toMatchObject({ at: 'past', playing: false, momentMs: FROM_MS + 19_900 });
      expect(rig.sink.newest?.seq).toBe(199);
    }
    expect(rig.player.nowMs).toBe(FROM_MS + 19_900);
  });

  it.each([
    ['before it', -60_000, 0],
    ['after it', 60_000_000, 19_900],
  ])('says so when a link names a moment %s, and shows the nearest', async (_, askedMs, shownMs) => {
    const { rig } = rigOf(exported(SEGMENTS));
    rig.player.openAt(FROM_MS + askedMs);
    await rig.pass(500);
    const { note, momentMs, at } = rig.player.playhead;
    expect({ note, at, shownMs: momentMs - FROM_MS }).toEqual({ note: 'not-kept', at: 'past', shownMs });
  });

  it('shows poses under a finger from its pages of KEYs, each read once', async () => {
    const { rig, files } = rigOf(exported(SEGMENTS));
    rig.player.openAt(FROM_MS);
    await rig.pass(200);
    rig.player.attend();
    await rig.pass(200);
    files.asked.length = 0;
    for (const second of [3, 9, 15, 3]) {
      rig.player.seek(FROM_MS + 1000 * second, true);
      await rig.pass(50);
    }
    expect(files.asked.filter((path) => path.startsWith('keys/'))).toEqual([]);
    expect(rig.sink.newest!.seq).toBeGreaterThan(10);
    const { source } = opened(exported(SEGMENTS));
    await source.loadKeys(source.span);
    expect(source.keyAt(FROM_MS + 5000)?.seq).toBe(40);
  });

  it('goes on when its host is back, and says that it was away', async () => {
    const { rig, files } = rigOf(exported(SEGMENTS));
    rig.player.openAt(FROM_MS);
    await rig.pass(200);
    rig.player.toggle();
    await rig.pass(500);
    files.isAway = true;
    await rig.pass(12_000);
    expect(rig.player.playhead.note).toBe('away');
    const held = rig.sink.seqs.length;
    expect(held).toBeGreaterThan(20); // what was prefetched
    expect(held).toBeLessThan(150);
    files.isAway = false;
    await rig.pass(30_000);
    expect(rig.sink.seqs).toEqual(range(0, 200));
  });
});

describe('parts that are lost', () => {
  /** A whole playback with some files changed: what was shown, and what is reported as missing. */
  const played = async (change: (files: FilesHere) => void) => {
    const made = rigOf(exported(SEGMENTS));
    change(made.files);
    made.rig.player.openAt(FROM_MS);
    await made.rig.pass(200);
    made.rig.player.toggle();
    await made.rig.pass(26_000);
    await made.clock.pass(1000);
    const shown = new Set(made.rig.sink.jumps.flat().map(({ seq }) => seq));
    return { ...made, missing: range(0, 200).filter((seq) => !shown.has(seq)) };
  };
  const bytesOf = (segment: Segment) => encodeSegment(segment);
  const as = (more: object): Uint8Array => {
    const segment = SEGMENTS[3]!;
    return bytesOf({ ...segment, start: { ...segment.start, ...more } });
  };

  it.each<[string, (files: FilesHere) => void]>([
    ['missing', ({ files }) => void files.delete(pathOf(3))],
    ['cut', ({ files }) => void files.set(pathOf(3), files.get(pathOf(3))!.subarray(0, -20))],
    ['empty', ({ files }) => void files.set(pathOf(3), new Uint8Array())],
    [
      'damaged',
      ({ files }) =>
        void files.set(
          pathOf(3),
          files.get(pathOf(3))!.map((byte, i) => (i === 300 ? byte ^ 1 : byte)),
        ),
    ],
    ['of another robot', ({ files }) => void files.set(pathOf(3), as({ robot: 'other' }))],
    ['of another view', ({ files }) => void files.set(pathOf(3), as({ view: 'lab' }))],
    ['of another take', ({ files }) => void files.set(pathOf(3), as({ take: 'b'.repeat(16) }))],
    ['of another time', ({ files }) => void files.set(pathOf(3), as({ fromMs: FROM_MS + 1 }))],
  ])('one that is %s is a gap; the rest plays', async (_, change) => {
    const { missing, source } = await played(change);
    expect(missing).toEqual(range(60, 80));
    expect(source.lost).toEqual({ count: 1, isNewer: false });
    const inGap = source.timeline.movement.filter(({ fromMs }) => fromMs === FROM_MS + 6000);
    expect(inGap).toEqual([]);
    expect([5000, 7000, 9000].map((ms) => source.isLostAt(FROM_MS + ms))).toEqual([false, true, false]);
    expect(source.timeline.movement.length).toBe(SEGMENTS.length - 1);
  });

  it('the last one is a gap up to the end, where it rests', async () => {
    const last = SEGMENTS.length - 1;
    const { missing, rig } = await played(({ files }) => void files.delete(pathOf(last)));
    expect(missing).toEqual(range(20 * last, 200));
    expect(rig.player.playhead).toMatchObject({ at: 'past', playing: false, momentMs: FROM_MS + 19_900 });
    expect(rig.player.playhead.loop).toBeNull();
  });

  it('two that are swapped are two gaps', async () => {
    const { missing, source } = await played(({ files }) => {
      const [one, two] = [files.get(pathOf(2))!, files.get(pathOf(5))!];
      files.set(pathOf(2), two).set(pathOf(5), one);
    });
    expect(missing).toEqual([...range(40, 60), ...range(100, 120)]);
    expect(source.lost.count).toBe(2);
  });

  it('of a later version are said to be made by a newer Posecast', async () => {
    const { source } = await played(({ files }) => {
      const newer = files.get(pathOf(3))!.slice();
      newer[4] = 2;
      files.set(pathOf(3), newer);
    });
    expect(source.lost).toEqual({ count: 1, isNewer: true });
  });

  it('all of them leave a page that stands', async () => {
    const { rig, source } = await played(({ files }) => {
      for (const segment of SEGMENTS) files.delete(segmentPath(segment.start));
    });
    expect(rig.sink.newest).toBeUndefined();
    expect(source.lost.count).toBeGreaterThan(0);
  });

  it('a page of KEYs that is missing or of another robot harms nobody', async () => {
    const files = exported(SEGMENTS);
    const { source } = opened(files);
    files.files.delete(keyPagePath(FROM_MS));
    expect(await why(source.loadKeys(source.span))).toBe('gone');
    expect(source.keyAt(FROM_MS)).toBeNull();
    expect(source.lost.count).toBe(0);
  });
});

describe('an index', () => {
  const doc = () => indexOf(exported(SEGMENTS));

  it('of a newer Posecast, damaged or empty is refused, with what and where', () => {
    expect(reading(doc())).toBe('read');
    expect(reading({ ...doc(), version: 2 })).toMatch(/^newer: /);
    expect(reading('{"format": "posec')).toMatch(/^damaged: .*JSON/);
    expect(reading({ ...doc(), robot: 'No Robot' })).toMatch(/^damaged: robot/);
    expect(reading({ ...doc(), segments: [] })).toMatch(/^damaged: segments/);
    expect(reading({ ...doc(), format: 'else' })).toMatch(/^damaged: format/);
    expect(reading('')).toMatch(/^damaged/);
  });

  it('of many segments is read, and each of them found', () => {
    const count = process.env.POSECAST_FULL === '1' ? 200_000 : 20_000;
    const segments = Array.from({ length: count }, (_, n) => {
      return [0, n, 2000 * n, 1999, 60, 60 * n, 60 * n + 59, 8000, 0, 0, 0];
    });
    const files = exported(SEGMENTS.slice(0, 1));
    const many = { ...doc(), to_ms: FROM_MS + 2000 * count, segments, words: [], events: [] };
    files.files.set('recording.json', new TextEncoder().encode(JSON.stringify(many)));
    const { source } = opened(files);
    expect(source.timeline.movement.length).toBe(count);
    for (const n of [0, 1, 7777, count - 2]) {
      const atMs = FROM_MS + 2000 * n;
      const found = source.segmentsIn({ fromMs: atMs, toMs: atMs + 2500 });
      expect(found.map(({ index }) => index)).toEqual([n, n + 1]);
    }
  });
});

it('nothing is told to a closed recording', async () => {
  const { source, clock } = opened(exported(SEGMENTS));
  let told = 0;
  source.onChange(() => {
    told += 1;
  });
  const lost = why(source.segment({ ...refsOf(source)[0]!, index: 99 }));
  source.close();
  await lost;
  await clock.pass(1000);
  await settled();
  expect(told).toBe(0);
});
