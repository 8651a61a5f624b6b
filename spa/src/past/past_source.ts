import type { KeyPose, RobotStatus, Schema, Segment } from '@posecast/wire';
import type { PastEvent, Span, Timeline } from './past_types.ts';

/** The index entry of a segment; see *The past* in `docs/reference/protocol.md`. */
export interface SegmentRef extends Span {
  /** 16 hexadecimal digits, like `runId`. */
  readonly take: string;
  readonly index: number;
  readonly runId: string;
  readonly frames: number;
  readonly bytes: number;
  /** The hash of its bytes, hexadecimal, like `schema` and `model`; empty if only the segment itself can prove its integrity. */
  readonly sha256: string;
  readonly schema: string | null;
  readonly model: string | null;
  /** Frames of its run that were lost before it. */
  readonly missing: number;
  readonly words: readonly { readonly atMs: number; readonly word: RobotStatus }[];
  readonly events: readonly PastEvent[];
}

/** Identifies a segment among all of a robot's segments. */
export function nameOfRef({ take, index }: Pick<SegmentRef, 'take' | 'index'>): string {
  return `${take}/${index}`;
}

/** Why something in the past is unavailable. `gone`: it is no longer kept, or not visible to this page. `away`: its source does
 *  not answer; it may later. */
export class PastError extends Error {
  readonly why: 'damaged' | 'gone' | 'away';

  constructor(why: PastError['why'], message: string) {
    super(message);
    this.why = why;
  }
}

/** The result of `decode`; if it rejects the data with a `Refusal`, `name` is damaged. */
export function decoded<T>(name: string, Refusal: new () => Error, decode: () => T): T {
  try {
    return decode();
  } catch (error) {
    if (error instanceof Refusal) throw new PastError('damaged', `${name}: ${error.message}`);
    throw error;
  }
}

/** The source of a robot's past. What was fetched once is cached, within a bound. */
export interface PastSource {
  /** What may be seen; null while nothing is known, and if there is no past that this page may see. */
  readonly timeline: Timeline | null;
  /** What was deleted while it was known or could be; every change makes a new array. Absent if nothing ever is. */
  readonly deleted?: readonly Span[];
  /** Adds a listener for `timeline`. Returns a function that removes it. */
  readonly onChange: (listener: () => void) => () => void;
  /** How often the newest data is requested: `idle` while nobody looks back, otherwise `near`. */
  follow(how: 'idle' | 'near'): void;
  /** Fetches the per-minute data of the days (UTC) in a span, as far as it is unknown. Rejects with a `PastError`. Absent if the
   *  source knows everything from the start. */
  loadDays?(span: Span): Promise<void>;
  /** Fetches the index of a span, as far as it is kept and still unknown. Rejects with a `PastError`. */
  loadIndex(span: Span): Promise<void>;
  /** The known segments that overlap a span, by start, then by take; the first `most` of them. */
  segmentsIn(span: Span, most?: number): readonly SegmentRef[];
  /** Fetches the first poses of the segments in a span. `everyMs`: one pose per this interval is enough. Rejects with a
   *  `PastError`. */
  loadKeys(span: Span, everyMs?: number): Promise<void>;
  /** The newest loaded first pose at or before a moment, else the oldest after it; null if none in its ten minutes is loaded. */
  keyAt(momentMs: number): KeyPose | null;
  /** A segment, verified by its hash. Rejects with a `PastError`. */
  segment(ref: SegmentRef, signal?: AbortSignal): Promise<Segment>;
  /** A segment byte for byte, verified by its hash and not cached. Rejects with a `PastError`. */
  segmentBytes(ref: SegmentRef, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>>;
  /** A schema by its hash. Rejects with a `PastError`. */
  schema(sha256: string): Promise<Schema>;
  close(): void;
}
