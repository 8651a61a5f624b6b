import { type EventMessage, FrameError, type KeyPose, type RobotStatus } from '@posecast/wire';
import type { PastSink } from '../past_types.ts';
import { type Happening, type Situation, Teller } from './tape/happenings.ts';
import type { OwnTape } from './tape/own_tape.ts';
import type { Near, Next } from './tape/reel.ts';
import type { SchemaReader, TapeFrame, TapePart } from './tape/tape.ts';

/** Shows frames, and the events around them, to a sink. Keeps track of what it has shown since the newest jump. */
export class Projector {
  /** The newest frame shown; null while only the first pose of a segment is shown. */
  cursor: TapeFrame | null = null;
  /** Whether the sink has received the states that led up to it. */
  isLed = false;
  readonly #teller: Teller;
  readonly #own: OwnTape;
  /** The first pose of a segment, shown until the frame has loaded. */
  #key: KeyPose | null = null;
  /** Events up to the moment of the newest jump are part of its situation. */
  #jumpMs = 0;
  /** How many of a segment's happenings have been sent since. */
  #told = new WeakMap<TapePart, number>();
  #ownToldMs = 0;

  /** `listRecent` returns the events before a moment that a viewer who joined then would have received. */
  constructor(
    sink: PastSink,
    own: OwnTape,
    private readonly listRecent: (momentMs: number) => readonly EventMessage[],
  ) {
    this.#teller = new Teller(sink);
    this.#own = own;
  }

  /** Jumps to a moment. */
  show(frame: TapeFrame | null, momentMs: number, situation: Situation): void {
    this.#teller.jump();
    if (frame !== null) this.#teller.schema(frame.schema);
    this.#teller.situation({ ...situation, faults: [...this.listRecent(momentMs), ...situation.faults] });
    if (frame !== null) this.#teller.state(frame.schema, frame);
    this.cursor = frame;
    this.isLed = false;
    this.#key = null;
    this.#jumpMs = momentMs;
    this.#ownToldMs = momentMs;
    this.#told = new WeakMap();
  }

  /** Jumps to the first pose of a segment whose other data is not loaded. */
  showKey(pose: KeyPose, { schema, decoder }: SchemaReader, readWord: () => RobotStatus | null): void {
    const { runId, seq, model, copies, lateUs, atMs } = pose;
    if (this.#key?.runId === runId && this.#key.seq === seq) return;
    try {
      for (const copy of copies) decoder.decode(copy);
      const { tS, codes } = decoder.decode(pose.frame);
      this.#teller.jump();
      this.#teller.schema(schema);
      this.#teller.model(model);
      this.#teller.events(this.listRecent(atMs));
      this.#teller.word(readWord());
      this.#teller.state(schema, { schemaId: schema.id, seq, tS, codes, atMs, lateMs: lateUs / 1000 });
      this.#key = pose;
      this.cursor = null;
    } catch (error) {
      if (!(error instanceof FrameError)) throw error;
    }
  }

  /** Shows the next frame. */
  deliver(next: Next, near: Near): void {
    this.tell(near, next.frame.atMs, next);
    this.#teller.state(next.frame.schema, next.frame);
    this.cursor = next.frame;
    this.isLed = false;
  }

  /** Sends the happenings up to a moment, or before a frame. */
  tell({ parts }: Near, momentMs: number, next: Next | null = null): void {
    const news: Happening[] = [];
    for (const part of parts) {
      const { happenings } = part;
      let told = this.#told.get(part) ?? happenings.filter(({ atMs }) => atMs <= this.#jumpMs).length;
      for (; told < happenings.length; told += 1) {
        const { atMs, place } = happenings[told]!;
        if (part === next?.part ? place > next.place : atMs > momentMs) break;
        news.push(happenings[told]!);
      }
      this.#told.set(part, told);
    }
    const isRecorded = ({ atMs }: Happening): boolean =>
      parts.some(({ ref }) => atMs >= ref.fromMs && atMs <= ref.toMs);
    const own = this.#own.happenings(this.#ownToldMs, momentMs).filter((each) => !isRecorded(each));
    this.#ownToldMs = Math.max(this.#ownToldMs, momentMs);
    for (const each of [...news, ...own].sort((a, b) => a.atMs - b.atMs)) this.#teller.change(each);
  }
}
