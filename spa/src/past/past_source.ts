import type { KeyPose, RobotStatus, Schema, Segment } from '@posecast/wire';
import type { PastEvent, Span, Timeline } from './past_types.ts';

/** What the index says of a segment, see *The past* in `docs/reference/protocol.md`. */
export interface SegmentRef extends Span {
  /** 16 hexadecimal digits, like `runId`. */
  readonly take: string;
  readonly index: number;
  readonly runId: string;
  readonly frames: number;
  readonly bytes: number;
  /** Of its bytes, hexadecimal, like `schema` and `model`; empty where only the segment itself says whether it is whole. */
  readonly sha256: string;
  readonly schema: string | null;
  readonly model: string | null;
  /** Frames of its run that got lost before it. */
  readonly missing: number;
  readonly words: readonly { readonly atMs: number; readonly word: RobotStatus }[];
  readonly events: readonly PastEvent[];
}

/** Why something of the past can't be had. `gone`: it is not kept any more, or not for this page. `away`: its source does
 *  not answer; it may later. */
export class PastError extends Error {
  readonly why: 'damaged' | 'gone' | 'away';

  constructor(why: PastError['why'], message: string) {
    super(message);
    this.why = why;
  }
}

/** Where a robot's past comes from. What was fetched once is kept, within a bound. */
export interface PastSource {
  /** What may be seen; null while nothing is known, and where there is no past that this page may see. */
  readonly timeline: Timeline | null;
  /** Adds a listener for `timeline`. Returns a function that removes it. */
  readonly onChange: (listener: () => void) => () => void;
  /** How often the newest is asked for: `idle` while nobody looks back, else `near`. */
  follow(how: 'idle' | 'near'): void;
  /** Fetches, by minutes, what was recorded on the days (UTC) of a span, as far as that is not known. Rejects with a
   *  `PastError`. A source that knows all from the start has none. */
  loadDays?(span: Span): Promise<void>;
  /** Fetches the index of a span, as far as it is kept and not known yet. Rejects with a `PastError`. */
  loadIndex(span: Span): Promise<void>;
  /** The known segments that have a part in a span, by beginning, then take. */
  segmentsIn(span: Span): readonly SegmentRef[];
  /** Fetches the first poses of the segments of a span. `everyMs`: one in so long will do. Rejects with a `PastError`. */
  loadKeys(span: Span, everyMs?: number): Promise<void>;
  /** The newest loaded first pose at or before a moment, else the oldest behind it; null if none of its ten minutes is
   *  loaded. */
  keyAt(momentMs: number): KeyPose | null;
  /** A segment, checked against its hash. Rejects with a `PastError`. */
  segment(ref: SegmentRef, signal?: AbortSignal): Promise<Segment>;
  /** A segment byte for byte, checked against its hash and not kept. Rejects with a `PastError`. */
  segmentBytes(ref: SegmentRef, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>>;
  /** A schema by its hash. Rejects with a `PastError`. */
  schema(sha256: string): Promise<Schema>;
  close(): void;
}
