import {
  encodeKeyPage,
  encodeRecording,
  encodeSegment,
  keyPagePath,
  type Segment,
  segmentPath,
} from '@posecast/wire';
import { PastError } from '../../src/past/past_source.ts';
import type { RecordingFiles } from '../../src/past/recording/recording_files.ts';
import { readIndex } from '../../src/past/recording/recording_index.ts';
import { RecordingPast } from '../../src/past/recording/recording_past.ts';
import { refOf, SCHEMA, SCHEMA_SHA } from './past_recordings.ts';
import { PageClock } from './past_rig.ts';

const PAGE_MS = 600_000;

/** The files of a recording, in memory: a test can remove, cut or swap them. */
export class FilesHere implements RecordingFiles {
  readonly files = new Map<string, Uint8Array>();
  /** The paths that were read. */
  readonly asked: string[] = [];
  isAway = false;

  async read(path: string, most: number): Promise<Uint8Array<ArrayBuffer>> {
    this.asked.push(path);
    await Promise.resolve();
    if (this.isAway) throw new PastError('away', `${path}: no answer`);
    const bytes = this.files.get(path);
    if (bytes === undefined) throw new PastError('gone', `${path}: answered 404`);
    if (bytes.length > most) throw new PastError('damaged', `${path}: too long`);
    return Uint8Array.from(bytes);
  }
}

/** Arranges segments as an export does. */
export function exported(
  segments: readonly Segment[],
  notes: readonly { atMs: number; text: string }[] = [],
): FilesHere {
  const here = new FilesHere();
  const refs = segments.map(refOf).map(({ sha256: _, words, events, ...ref }) => ({
    ...ref,
    ...{ firstSeq: 0, lastSeq: 0, words },
    events: events.map(({ atMs, ...event }) => ({ atMs, event })),
  }));
  const pages = new Map<number, Segment[]>();
  segments.forEach((segment, i) => {
    here.files.set(segmentPath(refs[i]!), encodeSegment(segment));
    const page = Math.floor(segment.start.fromMs / PAGE_MS) * PAGE_MS;
    if (refs[i]!.frames > 0) pages.set(page, [...(pages.get(page) ?? []), segment]);
  });
  for (const [fromMs, some] of pages)
    here.files.set(keyPagePath(fromMs), encodeKeyPage({ robot: 'r', view: 'public', fromMs }, some));
  here.files.set(
    'recording.json',
    encodeRecording({
      ...{ robot: 'r', view: 'public', title: 'A walk', author: null, licence: null, notes },
      fromMs: refs[0]!.fromMs,
      toMs: Math.max(...refs.map(({ toMs }) => toMs)),
      schemas: new Map([[SCHEMA_SHA, SCHEMA.text]]),
      models: ['ab'.repeat(32)],
      segments: refs.sort((a, b) => a.fromMs - b.fromMs || (a.take < b.take ? -1 : 1)),
    }),
  );
  return here;
}

/** A recording opened from files, with a clock for delayed work. */
export function opened(files: FilesHere): { source: RecordingPast; clock: PageClock } {
  const clock = new PageClock();
  const source = new RecordingPast(readIndex(files.files.get('recording.json')!), {
    files,
    later: clock.later,
  });
  return { source, clock };
}
