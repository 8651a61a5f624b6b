/** Many short segments, as no recorder makes them: what they cost grows with what is near the shown moment, not with all. */

import { describe, expect, it, vi } from 'vitest';
import { recordedAs } from '../../src/app/pages/recording/recording_words.ts';
import { PastError, type SegmentRef } from '../../src/past/past_source.ts';
import { Coming } from '../../src/past/player/around.ts';
import type { RecordingFiles } from '../../src/past/recording/recording_files.ts';
import { type RecordingIndex, readIndex } from '../../src/past/recording/recording_index.ts';
import { RecordingPast } from '../../src/past/recording/recording_past.ts';
import { Rig } from '../rigs/past_player_rig.ts';
import { FROM_MS, RUN, recorded, SCHEMA, SCHEMA_SHA, sent, TAKE } from '../rigs/past_recordings.ts';
import { PageClock } from '../rigs/past_rig.ts';
import { exported } from '../rigs/recording_rig.ts';

vi.setConfig({ testTimeout: 120_000 });

const EVERY_MS = 10;

/** A player of a recording. It counts how often somebody looks at a segment of the index, and how many files are read at once. */
function playing(index: RecordingIndex, files: RecordingFiles) {
  const counts = { looks: 0, reads: 0, atOnce: 0 };
  let running = 0;
  const get = (ref: SegmentRef, name: string | symbol) => {
    counts.looks += 1;
    return ref[name as keyof SegmentRef];
  };
  const source = new RecordingPast(
    { ...index, segments: index.segments.map((ref) => new Proxy(ref, { get })) },
    {
      files: {
        read: async (path, most) => {
          counts.reads += 1;
          counts.atOnce = Math.max(counts.atOnce, ++running);
          return files.read(path, most).finally(() => {
            running -= 1;
          });
        },
      },
      later: new PageClock().later,
    },
  );
  const rig = new Rig(
    source,
    recordedAs(source.span, (momentMs) => source.isLostAt(momentMs)),
  );
  counts.looks = 0;
  return { rig, counts };
}

/** Segments of a frame each. */
function played(count: number) {
  const segments = sent(count, { everyMs: EVERY_MS, keyEveryS: 0.001 }).flatMap((frame, i) =>
    recorded([frame], { firstIndex: i }),
  );
  const files = exported(segments);
  return playing(readIndex(files.files.get('recording.json')!), files);
}

/** Rows of an index without any file. */
function lost(count: number, everyMs = EVERY_MS) {
  const segments = Array.from({ length: count }, (_, index): SegmentRef => {
    const fromMs = FROM_MS + index * everyMs;
    return {
      ...{ take: TAKE, index, runId: RUN, fromMs, toMs: fromMs + EVERY_MS, frames: 1, bytes: 1000 },
      ...{ sha256: '', schema: SCHEMA_SHA, model: null, missing: 0, words: [], events: [] },
    };
  });
  const index: RecordingIndex = {
    ...{ robot: 'r', view: 'public', title: null, author: null, licence: null, notes: [], models: [] },
    ...{
      fromMs: FROM_MS,
      toMs: segments.at(-1)!.toMs,
      segments,
      schemas: new Map([[SCHEMA_SHA, SCHEMA.text]]),
    },
  };
  return playing(index, {
    read: async (path) => {
      throw new PastError('gone', `${path}: no such entry`);
    },
  });
}

describe('many short segments', () => {
  it('that are lost are each asked for once, and looked at a few times', async () => {
    const cost = async (count: number) => {
      const { rig, counts } = lost(count);
      rig.player.openAt(FROM_MS);
      while (counts.reads < count) await rig.pass(50);
      expect(counts.reads).toBe(count);
      expect(counts.atOnce).toBeLessThanOrEqual(8);
      return counts.looks;
    };
    const [few, many] = [await cost(500), await cost(4000)];
    // eight times as many, each found by halving: 14 times as many looks; a quadratic cost has 64 times as many
    expect(many).toBeLessThan(20 * few);
    expect(many).toBeLessThan(400 * 4000);
  });

  it('cost the same wherever one looks and plays, however many there are', async () => {
    const cost = async (count: number) => {
      const { rig, counts } = played(count);
      rig.player.openAt(FROM_MS + (count * EVERY_MS) / 2);
      await rig.pass(1000);
      expect(rig.sink.seqs).toEqual([count / 2]);
      const opened = counts.looks;
      counts.looks = 0;
      rig.player.toggle();
      await rig.pass(1000);
      expect(rig.sink.seqs.length).toBeGreaterThan(50);
      const toPlay = counts.looks;
      counts.looks = 0;
      rig.player.extend(Coming).after(rig.player.frame!);
      expect(counts.atOnce).toBeLessThanOrEqual(8 + 16);
      return { opened, toPlay, toPlot: counts.looks };
    };
    const [few, many] = [await cost(1000), await cost(4000)];
    expect(many.opened).toBeLessThan(1.5 * few.opened);
    expect(many.toPlay).toBeLessThan(1.5 * few.toPlay);
    expect(many.toPlot).toBeLessThan(2.5 * few.toPlot);
  });

  it('may all be of one moment', async () => {
    const { rig, counts } = lost(20_000, 0);
    rig.player.openAt(FROM_MS);
    await rig.pass(50);
    rig.player.step(1);
    rig.player.visitFault(1);
    await rig.pass(50);
    expect(counts.atOnce).toBeLessThanOrEqual(8);
  });
});
