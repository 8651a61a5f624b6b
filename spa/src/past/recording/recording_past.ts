import {
  decodeKeyPage,
  decodeSegment,
  type KeyPose,
  keyPagePath,
  parseSchema,
  type Schema,
  SchemaError,
  type Segment,
  SegmentError,
  segmentPath,
  unpackSegment,
} from '@posecast/wire';
import { BoundedCache, Emitter, firstPlace } from '../../kit.ts';
import { decoded, nameOfRef, PastError, type PastSource, type SegmentRef } from '../past_source.ts';
import { PAGE_MS, type Span, type Timeline } from '../past_types.ts';
import { drawTimeline } from '../relay/past_timeline.ts';
import { SharedRequests } from '../requests.ts';
import { BYTES_MAX, type RecordingFiles } from './recording_files.ts';
import type { RecordingIndex } from './recording_index.ts';

const SEGMENTS_KEPT_BYTES = 8 << 20;
const KEYS_KEPT_BYTES = 4_000_000;
/** Parts that turn out to be missing within this time are removed from the time line together, ms. */
const REDRAW_MS = 250;

export interface RecordingPorts {
  readonly files: RecordingFiles;
  /** Calls `run` after `ms`. Returns a function that cancels it. */
  readonly later: (ms: number, run: () => void) => () => void;
}

/** The parts of a recording that can't be played. */
export interface LostParts {
  /** Parts known to be missing, corrupt or not what the index says. */
  readonly count: number;
  /** Some of them were made by a newer Posecast. */
  readonly isNewer: boolean;
}

const NONE_LOST: LostParts = { count: 0, isNewer: false };

/** A recording in files. Its index is known from the start; segments and pages of KEYs are read on demand. */
export class RecordingPast implements PastSource {
  readonly #index: RecordingIndex;
  readonly #ports: RecordingPorts;
  readonly #shared = new SharedRequests();
  readonly #segments = new BoundedCache<string, Segment>(SEGMENTS_KEPT_BYTES);
  readonly #keys = new BoundedCache<number, readonly KeyPose[]>(KEYS_KEPT_BYTES);
  readonly #changed = new Emitter();
  readonly #losses = new Set<string>();
  /** The latest end of each segment and all earlier ones, ms: it never decreases. */
  readonly #reach: Float64Array;
  #lost = NONE_LOST;
  #timeline: Timeline;
  #stopRedraw: (() => void) | null = null;

  constructor(index: RecordingIndex, ports: RecordingPorts) {
    this.#index = index;
    this.#ports = ports;
    this.#reach = new Float64Array(index.segments.length);
    let reachMs = Number.NEGATIVE_INFINITY;
    index.segments.forEach(({ toMs }, i) => {
      reachMs = Math.max(reachMs, toMs);
      this.#reach[i] = reachMs;
    });
    this.#timeline = drawTimeline(this.span, index.segments, []);
  }

  /** The whole recording. */
  get span(): Span {
    const { fromMs, toMs } = this.#index;
    return { fromMs, toMs };
  }

  /** The known missing parts. Every change makes a new object. */
  get lost(): LostParts {
    return this.#lost;
  }

  get timeline(): Timeline {
    return this.#timeline;
  }

  readonly onChange = this.#changed.on;

  follow(): void {
    // nothing is added
  }

  async loadIndex(): Promise<void> {
    // everything is available
  }

  segmentsIn({ fromMs, toMs }: Span, most = Number.POSITIVE_INFINITY): readonly SegmentRef[] {
    const { segments } = this.#index;
    const found: SegmentRef[] = [];
    for (let i = this.#firstReaching(fromMs); i < segments.length; i += 1) {
      const ref = segments[i]!;
      if (ref.fromMs > toMs || found.length >= most) break;
      if (ref.toMs >= fromMs) found.push(ref);
    }
    return found;
  }

  /** Whether the part at this moment is known to be missing or damaged. */
  isLostAt(momentMs: number): boolean {
    if (this.#losses.size === 0) return false;
    return this.segmentsIn({ fromMs: momentMs, toMs: momentMs }).some((ref) =>
      this.#losses.has(nameOfRef(ref)),
    );
  }

  async loadKeys({ fromMs, toMs }: Span): Promise<void> {
    const [firstMs, lastMs] = [Math.max(fromMs, this.span.fromMs), Math.min(toMs - 1, this.span.toMs)];
    for (let pageMs = firstMs - (firstMs % PAGE_MS); pageMs <= lastMs; pageMs += PAGE_MS) {
      if (this.#keys.get(pageMs) !== undefined || !this.#hasPoses(pageMs)) continue;
      await this.#shared.ask(`keys ${pageMs}`, (signal) => this.#readKeys(pageMs, signal));
    }
  }

  keyAt(momentMs: number): KeyPose | null {
    const poses = this.#keys.use(momentMs - (momentMs % PAGE_MS));
    return poses?.findLast(({ atMs }) => atMs <= momentMs) ?? poses?.[0] ?? null;
  }

  async segment(ref: SegmentRef, signal?: AbortSignal): Promise<Segment> {
    signal?.throwIfAborted();
    const name = nameOfRef(ref);
    const known = this.#segments.use(name);
    if (known !== undefined) return known;
    try {
      return await this.#shared.ask(name, (stop) => this.#readSegment(ref, stop), signal);
    } catch (error) {
      throw this.#lose(name, error);
    }
  }

  /** Not cached. Its content is not checked, except that it can be unpacked. */
  async segmentBytes(ref: SegmentRef, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    signal?.throwIfAborted();
    try {
      return await this.#readBytes(ref, signal);
    } catch (error) {
      throw this.#lose(nameOfRef(ref), error);
    }
  }

  async schema(sha256: string): Promise<Schema> {
    const name = `schema ${sha256.slice(0, 8)}`;
    const text = this.#index.schemas.get(sha256);
    if (text === undefined) throw new PastError('damaged', `${name}: not in the recording`);
    return decoded(name, SchemaError, () => parseSchema(text));
  }

  close(): void {
    this.#stopRedraw?.();
    this.#shared.close();
    this.#changed.clear();
  }

  #hasPoses(pageMs: number): boolean {
    const { segments } = this.#index;
    const untilMs = pageMs + PAGE_MS;
    for (let i = this.#firstReaching(pageMs); i < segments.length; i += 1) {
      const { fromMs, frames } = segments[i]!;
      if (fromMs >= untilMs) return false;
      if (fromMs >= pageMs && frames > 0) return true;
    }
    return false;
  }

  async #readKeys(pageMs: number, signal: AbortSignal): Promise<void> {
    const path = keyPagePath(pageMs);
    const bytes = await this.#ports.files.read(path, BYTES_MAX.keys, signal);
    const page = decoded(path, SegmentError, () => decodeKeyPage(bytes));
    if (page.fromMs !== pageMs || !this.#isOurs(page))
      throw new PastError('damaged', `${path}: another page`);
    this.#keys.set(pageMs, page.poses, bytes.length);
  }

  async #readSegment(ref: SegmentRef, signal: AbortSignal): Promise<Segment> {
    const path = segmentPath(ref);
    const bytes = await this.#readBytes(ref, signal);
    const segment = decoded(path, SegmentError, () => decodeSegment(bytes));
    const { take, index, fromMs, schema } = segment.start;
    const isIt = take === ref.take && index === ref.index && fromMs === ref.fromMs && schema === ref.schema;
    if (!isIt || !this.#isOurs(segment.start)) throw new PastError('damaged', `${path}: another segment`);
    this.#segments.set(nameOfRef(ref), segment, bytes.length);
    return segment;
  }

  /** A segment byte for byte; its file may be gzipped. */
  async #readBytes(ref: SegmentRef, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    const path = segmentPath(ref);
    const packed = await this.#ports.files.read(path, BYTES_MAX.segment, signal);
    try {
      return await unpackSegment(packed);
    } catch (error) {
      if (!(error instanceof SegmentError)) throw error;
      throw new PastError('damaged', `${path}: ${error.message}`);
    }
  }

  #isOurs({ robot, view }: { readonly robot: string; readonly view: string }): boolean {
    return robot === this.#index.robot && view === this.#index.view;
  }

  /** A part can't be played, for good: it becomes a gap. Returns the error. */
  #lose(name: string, error: unknown): unknown {
    if (!(error instanceof PastError) || error.why === 'away' || this.#losses.has(name)) return error;
    this.#losses.add(name);
    const isNewer = this.#lost.isNewer || /newer Posecast/.test(error.message);
    this.#lost = { count: this.#losses.size, isNewer };
    this.#stopRedraw ??= this.#ports.later(REDRAW_MS, () => {
      this.#stopRedraw = null;
      const kept = this.#index.segments.filter((ref) => !this.#losses.has(nameOfRef(ref)));
      this.#timeline = drawTimeline(this.span, kept, []);
      this.#changed.emit();
    });
    return error;
  }

  /** The index of the first segment that reaches a moment. */
  #firstReaching(momentMs: number): number {
    return firstPlace(this.#reach, (reachMs) => reachMs >= momentMs);
  }
}
