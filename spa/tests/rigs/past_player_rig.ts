import {
  decodeKeyPage,
  type EventMessage,
  encodeKeyPage,
  encodeSegment,
  type KeyPose,
  type RobotStatus,
  type Schema,
  type Segment,
} from '@posecast/wire';
import { PastError, type PastSource, type SegmentRef } from '../../src/past/past_source.ts';
import type { Mark, PastSink, PastState, Span, Timeline } from '../../src/past/past_types.ts';
import { PastPlayer } from '../../src/past/player/past_player.ts';
import { OwnTape } from '../../src/past/player/tape/own_tape.ts';
import type { Recorded } from '../../src/twin/liveness.ts';
import { FROM_MS, refOf, SCHEMA, SCHEMA_SHA, type Sent } from './past_recordings.ts';

const PAGE_MS = 600_000;

/** A source with the given segments. Requests are answered when `answer` is called. */
export class FakeSource implements PastSource {
  timeline: Timeline | null = null;
  /** The requests, in order. */
  readonly asked: string[] = [];
  readonly follows: string[] = [];
  /** How a segment is answered; by default with itself. */
  answer: (ref: SegmentRef) => Promise<void> = () => Promise.resolve();
  answerIndex: () => Promise<void> = () => Promise.resolve();
  isAway = false;
  #segments: { ref: SegmentRef; segment: Segment }[] = [];
  readonly #schemas: ReadonlyMap<string, Schema>;
  readonly #listeners = new Set<() => void>();
  readonly #indexed = new Set<number>();
  #poses: KeyPose[] = [];

  constructor(
    segments: readonly Segment[],
    schemas: Readonly<Record<string, Schema>> = { [SCHEMA_SHA]: SCHEMA },
  ) {
    this.#schemas = new Map(Object.entries(schemas));
    this.add(segments);
  }

  /** More has been recorded. */
  add(segments: readonly Segment[], marks: readonly Mark[] = this.timeline?.marks ?? []): void {
    this.#segments = [
      ...this.#segments,
      ...segments.map((segment) => ({ segment, ref: refOf(segment) })),
    ].sort(({ ref: a }, { ref: b }) => a.fromMs - b.fromMs || (a.take < b.take ? -1 : 1));
    this.draw(marks);
  }

  draw(marks: readonly Mark[]): void {
    const refs = this.#segments.map(({ ref }) => ref);
    if (refs.length === 0) return;
    const movement = refs.map(({ fromMs, toMs, bytes }) => ({ fromMs, toMs, bytesPerS: bytes }));
    const toMs = Math.max(...refs.map((ref) => ref.toMs));
    this.timeline = { fromMs: refs[0]!.fromMs, toMs, movement, words: [], marks };
    for (const listener of this.#listeners) listener();
  }

  /** The oldest leave the window. */
  dropBefore(momentMs: number): void {
    this.#segments = this.#segments.filter(({ ref }) => ref.fromMs >= momentMs);
    this.draw(this.timeline!.marks);
  }

  deleted: readonly Span[] = [];
  /** The relay says that a span was deleted. */
  delete(span: Span): void {
    this.deleted = [...this.deleted, span];
    this.#segments = this.#segments.filter(({ ref }) => ref.fromMs >= span.toMs || ref.toMs <= span.fromMs);
    const marks = this.timeline!.marks.filter(({ atMs }) => atMs < span.fromMs || atMs >= span.toMs);
    this.timeline = null;
    if (this.#segments.length > 0) this.draw(marks);
    else for (const listener of this.#listeners) listener();
  }

  readonly onChange = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  follow(how: 'idle' | 'near'): void {
    this.follows.push(how);
  }

  async loadIndex({ fromMs, toMs }: Span): Promise<void> {
    this.asked.push('index');
    await this.answerIndex();
    if (this.isAway) throw new PastError('away', 'no answer');
    for (let page = Math.floor(fromMs / PAGE_MS); page * PAGE_MS < toMs; page += 1) this.#indexed.add(page);
  }

  segmentsIn({ fromMs, toMs }: Span): readonly SegmentRef[] {
    return this.#segments
      .map(({ ref }) => ref)
      .filter(
        (ref) =>
          ref.toMs >= fromMs && ref.fromMs <= toMs && this.#indexed.has(Math.floor(ref.fromMs / PAGE_MS)),
      );
  }

  async loadKeys({ fromMs, toMs }: Span): Promise<void> {
    this.asked.push('keys');
    await Promise.resolve();
    if (this.isAway) throw new PastError('away', 'no answer');
    for (let page = Math.floor(fromMs / PAGE_MS); page * PAGE_MS < toMs; page += 1) {
      const from = page * PAGE_MS;
      const within = this.#segments.filter(({ ref }) => Math.floor(ref.fromMs / PAGE_MS) === page);
      const robot = { robot: 'r', view: 'public', fromMs: from };
      const { poses } = decodeKeyPage(
        encodeKeyPage(
          robot,
          within.map(({ segment }) => segment),
        ),
      );
      this.#poses = [...this.#poses, ...poses].sort((a, b) => a.atMs - b.atMs);
    }
  }

  keyAt(momentMs: number): KeyPose | null {
    const page = Math.floor(momentMs / PAGE_MS);
    const near = this.#poses.filter(({ atMs }) => Math.floor(atMs / PAGE_MS) === page);
    return near.findLast(({ atMs }) => atMs <= momentMs) ?? near[0] ?? null;
  }

  async segment(ref: SegmentRef, signal?: AbortSignal): Promise<Segment> {
    this.asked.push(`${ref.take}/${ref.index}`);
    await this.answer(ref);
    signal?.throwIfAborted();
    if (this.isAway) throw new PastError('away', 'no answer');
    const found = this.#segments.find((each) => each.ref.take === ref.take && each.ref.index === ref.index);
    if (found === undefined) throw new PastError('gone', 'not kept');
    return found.segment;
  }

  async segmentBytes(ref: SegmentRef, signal?: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
    return encodeSegment(await this.segment(ref, signal)).slice();
  }

  async schema(sha256: string): Promise<Schema> {
    this.asked.push('schema');
    await Promise.resolve();
    const schema = this.#schemas.get(sha256);
    if (this.isAway || schema === undefined) throw new PastError('away', 'no answer');
    return schema;
  }

  close(): void {}

  /** The requested segments. */
  get fetched(): string[] {
    return this.asked.filter((what) => what.includes('/'));
  }
}

/** Records what it receives. */
export class FakeSink implements PastSink {
  readonly told: string[] = [];
  readonly fills: (readonly PastState[])[] = [];
  readonly leads: (readonly PastState[])[] = [];
  /** States, a list for each jump. */
  readonly jumps: PastState[][] = [];

  jump(): void {
    this.told.push('jump');
    this.jumps.push([]);
  }
  schema(schema: Schema): void {
    this.told.push(`schema ${schema.size}`);
  }
  model(sha256: string | null): void {
    this.told.push(`model ${sha256?.slice(0, 2) ?? null}`);
  }
  info(kv: ReadonlyMap<string, string>): void {
    this.told.push(`info ${[...kv.values()].join()}`);
  }
  event(event: EventMessage): void {
    this.told.push(`${event.text} ${event.state}`);
  }
  word(word: RobotStatus): void {
    this.told.push(word);
  }
  state(state: PastState): void {
    this.told.push(`${state.seq}`);
    this.jumps.at(-1)!.push(state);
  }
  lead(states: readonly PastState[]): void {
    this.leads.push(states);
  }
  fill(_schema: Schema, states: readonly PastState[]): void {
    this.fills.push(states);
  }

  /** The numbers of the frames since the newest jump. */
  get seqs(): number[] {
    return this.jumps.at(-1)?.map(({ seq }) => seq) ?? [];
  }
  get newest(): PastState | undefined {
    return this.jumps.findLast((states) => states.length > 0)?.at(-1);
  }
  /** What was received since the newest jump. */
  get since(): string[] {
    return this.told.slice(this.told.lastIndexOf('jump') + 1);
  }
}

/** A player with a clock controlled by the test. */
export class Rig<Source extends PastSource = FakeSource> {
  nowMs = FROM_MS + 3_600_000;
  readonly sink = new FakeSink();
  readonly own = new OwnTape();
  /** How many pictures were asked for. */
  ticks = 0;
  /** Events of the live stream. */
  heard: EventMessage[] = [];
  readonly player: PastPlayer;
  #timers: { run: () => void; atMs: number }[] = [];

  constructor(
    readonly source: Source,
    recorded: Recorded | null = null,
  ) {
    this.player = new PastPlayer({
      source,
      recorded,
      own: this.own,
      sink: this.sink,
      heard: () => this.heard,
      nowMs: () => this.nowMs,
      schedule: (run, afterMs) => {
        const timer = { run, atMs: this.nowMs + afterMs };
        this.#timers.push(timer);
        return () => {
          this.#timers = this.#timers.filter((each) => each !== timer);
        };
      },
    });
  }

  /** Delivers what has been answered, and runs what is due. */
  async settle(): Promise<void> {
    for (let i = 0; i < 30; i += 1) {
      await Promise.resolve();
      this.#runDue();
    }
  }

  /** Goes to a moment, and shows it. */
  async seek(momentMs: number): Promise<void> {
    this.player.seek(momentMs);
    await this.settle();
  }

  async visitFault(by: 1 | -1): Promise<void> {
    this.player.visitFault(by);
    await this.settle();
  }

  /** Time passes, with a picture at each interval. */
  async pass(ms: number, everyMs = 50): Promise<void> {
    await this.settle();
    for (let left = ms; left > 0; left -= everyMs) {
      this.nowMs += Math.min(everyMs, left);
      this.#runDue();
      if (!this.player.isResting) {
        this.ticks += 1;
        this.player.tick();
      }
      await this.settle();
    }
  }

  #runDue(): void {
    const due = this.#timers.filter(({ atMs }) => atMs <= this.nowMs);
    this.#timers = this.#timers.filter(({ atMs }) => atMs > this.nowMs);
    for (const { run } of due) run();
  }

  /** The page receives a frame now. */
  receive({ seq, tS, codes }: Sent, schema: Schema = SCHEMA, lateMs = 0): void {
    const { nowMs } = this;
    this.own.push(schema, {
      ...{ schemaId: schema.id, seq, tS, codes, freshMs: nowMs, bornMs: nowMs, changedMs: nowMs },
      ...{ atMs: nowMs, lateMs },
    });
  }
}
