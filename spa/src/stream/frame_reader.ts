import { Decoder, type Frame, FrameError, type RelayMessage, type Schema, SchemaError } from '@posecast/wire';
import { poseDiffers } from '../twin/pose_change.ts';
import type { FromStream } from './messages.ts';
import { RateMeter } from './rate_meter.ts';

/** After a longer pause between frames nobody knows whether the pose moved meanwhile. */
const GAP_MS = 2500;

/** Of a frame's first byte: later frames may build on this one. */
const BASE = 0x02;

type Told = Extract<RelayMessage, { type: 'status' | 'schema' | 'info' | 'event' | 'model' }>;

/**
 * What one connection brings of the robot, read: bytes and messages go in, what the page is to know comes out by
 * `post`. The relay keeps per connection what a viewer was given, so each connection has a reader of its own.
 */
export class FrameReader {
  readonly #post: (message: FromStream) => void;
  readonly #decoder = new Decoder();
  readonly #rate = new RateMeter();
  #shownSchemaId: number | null = null;
  /** The newest frame that the relay has told of, and when it was new: null when the relay does not know. */
  #told: { seq: number; bornMs: number | null } | null = null;
  #freshMs: number | null = null;
  /** Poses are asked for: what comes is new, not what the relay had for a while. */
  #flows = true;
  #changedMs = 0;
  #newest: { schemaId: number; seq: number; codes: Int32Array; leftMs: number } | null = null;

  constructor(post: (message: FromStream) => void) {
    this.#post = post;
  }

  /** Frames a second, over the last two seconds. */
  hz(nowMs: number): number {
    return this.#rate.hz(nowMs);
  }

  /** Poses were not asked for until now: the next may be of any moment since the newest status. */
  resumed(): void {
    this.#flows = false;
  }

  /** `lateMs`: how long it had waited on its way, as far as that is known. */
  message(nowMs: number, lateMs: number, message: Told): void {
    switch (message.type) {
      case 'status':
        this.#status(nowMs, lateMs, message);
        return;
      case 'schema':
        this.#schema(message.text);
        return;
      case 'info':
        this.#post({ kind: 'info', kv: message.kv });
        return;
      case 'event':
        this.#post({ kind: 'event', event: message });
        return;
      case 'model':
        this.#post({ kind: 'model', hash: message.hash });
        return;
    }
  }

  frame(nowMs: number, lateMs: number, bytes: Uint8Array): void {
    let frame: Frame;
    try {
      frame = this.#decoder.decode(bytes);
    } catch (error) {
      // A frame we can't read changes nothing: the relay brings its base, and at the latest the next KEY mends it.
      if (error instanceof FrameError) return;
      throw error;
    }
    const { schema, seq, codes } = frame;
    // A KEY or REF that the relay had something newer than is there to be built upon: no news of the robot.
    if (bytes[0]! & BASE && seq < (this.#told?.seq ?? 0)) return;
    const leftMs = nowMs - lateMs;
    const before = this.#newest;
    const sameSchema = before !== null && before.schemaId === schema.id;
    const unsure = !sameSchema || leftMs - before.leftMs > GAP_MS;
    if (unsure || poseDiffers(schema, before.codes, codes)) this.#changedMs = nowMs;
    const told = this.#told;
    const fresh = this.#flows && told !== null && seq > told.seq;
    this.#flows = true;
    if (fresh) this.#freshMs = leftMs;
    this.#show(schema); // it may be one that was shown before the last
    this.#newest = { schemaId: schema.id, seq, codes, leftMs };
    this.#rate.recordArrival(nowMs);
    this.#post({
      kind: 'state',
      state: {
        schemaId: schema.id,
        seq,
        tS: frame.tS,
        codes: codes.slice(),
        freshMs: this.#freshMs,
        bornMs: fresh ? leftMs : told?.seq === seq ? told.bornMs : null,
        changedMs: this.#changedMs,
        atMs: nowMs,
        lateMs,
      },
    });
  }

  #status(nowMs: number, lateMs: number, status: Extract<Told, { type: 'status' }>): void {
    const leftMs = nowMs - lateMs;
    const { seq, age_ms } = status;
    this.#told = seq === null ? null : { seq, bornMs: age_ms === null ? null : leftMs - age_ms };
    // Its age is of when it left the relay. Of a frame that is here we know more: it is at least as old as it has been here.
    const heldMs = this.#newest?.seq === status.seq ? leftMs - this.#newest.leftMs : 0;
    this.#post({
      kind: 'status',
      status: {
        robot: status.robot,
        ageMs: status.age_ms === null ? null : Math.max(status.age_ms, heldMs),
        seq: status.seq,
        degraded: status.degraded,
        overShare: status.over_share,
        atMs: leftMs,
      },
    });
  }

  #schema(text: string): void {
    let schema: Schema;
    try {
      schema = this.#decoder.addSchema(text);
    } catch (error) {
      if (!(error instanceof SchemaError)) throw error;
      this.#post({ kind: 'problem', problem: { what: 'schema', detail: error.message } });
      return;
    }
    this.#show(schema);
  }

  #show(schema: Schema): void {
    if (schema.id === this.#shownSchemaId) return;
    this.#shownSchemaId = schema.id;
    this.#post({ kind: 'schema', schema });
  }
}
