import { decodeRecording, eventOf, type PastRecording, RecordingError } from '@posecast/wire';
import type { SegmentRef } from '../past_source.ts';
import type { Span } from '../past_types.ts';

/** A person's note about a moment of a recording. */
export interface Note {
  /** Unix ms. */
  readonly atMs: number;
  readonly text: string;
}

/** The index of a recording, times in unix ms. `segments`: by start, then take, then index. */
export interface RecordingIndex
  extends Span,
    Pick<PastRecording, 'robot' | 'view' | 'title' | 'author' | 'licence' | 'schemas' | 'models'> {
  /** Ascending. */
  readonly notes: readonly Note[];
  readonly segments: readonly SegmentRef[];
}

/** Why a recording can't be opened. `newer`: a newer Posecast made it. `damaged`: `what` says what is wrong and where. */
export class IndexError extends Error {
  constructor(
    readonly why: 'newer' | 'damaged',
    readonly what: string,
  ) {
    super(what);
  }
}

const NOTHING: readonly never[] = [];

/** Reads `recording.json`. Throws `IndexError`. */
export function readIndex(bytes: Uint8Array): RecordingIndex {
  const recording = decoded(bytes);
  const segments = recording.segments.map(({ firstSeq: _first, lastSeq: _last, words, events, ...ref }) => ({
    ...ref,
    sha256: '',
    words: words.length === 0 ? NOTHING : words,
    events:
      events.length === 0
        ? NOTHING
        : events.flatMap((recorded) => {
            const event = eventOf(recorded); // null: a kind that this page does not know
            return event === null ? [] : [{ ...event, atMs: recorded.atMs }];
          }),
  }));
  return { ...recording, segments };
}

function decoded(bytes: Uint8Array): PastRecording {
  try {
    return decodeRecording(bytes);
  } catch (error) {
    if (!(error instanceof RecordingError)) throw error;
    throw new IndexError(/newer Posecast/.test(error.message) ? 'newer' : 'damaged', error.message);
  }
}
