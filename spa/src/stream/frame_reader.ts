import {
  Decoder,
  type Frame,
  FrameError,
  type RelayMessage,
  type Schema,
  SchemaError,
  TAG_KEY,
} from '@posecast/wire';
import { poseDiffers } from '../twin/pose_change.ts';
import type { Delay } from './lateness.ts';
import type { FromStream } from './messages.ts';
import { RateMeter } from './pacing.ts';

/** After a longer pause between frames, the pose may have moved meanwhile, so it counts as changed. */
const GAP_MS = 2500;

type Told = Extract<RelayMessage, { type: 'status' | 'schema' | 'info' | 'event' | 'model' }>;

/**
 * Decodes the frames and messages of one connection, and passes the results to the page through `post`. The relay remembers per
 * connection which KEY the viewer has, so create a new reader for each connection.
 */
export class FrameReader {
  readonly #post: (message: FromStream) => void;
  readonly #decoder = new Decoder();
  readonly #rate = new RateMeter();
  #shownSchemaId: number | null = null;
  /** The newest frame that the relay's status named, and when it was new (null if the relay does not know). */
  #told: { seq: number; bornMs: number | null } | null = null;
  #freshMs: number | null = null;
  /** Whether frames arrive without a break. False after a pause: the relay may have had the next frame for a while. */
  #flows = true;
  #changedMs = 0;
  #newest: { schemaId: number; seq: number; codes: Int32Array; leftMs: number } | null = null;

  constructor(post: (message: FromStream) => void) {
    this.#post = post;
  }

  /** Frames per second over the last two seconds. */
  hz(nowMs: number): number {
    return this.#rate.hz(nowMs);
  }

  /** Poses are requested again after a pause: the next one may be as old as the newest status. */
  resumed(): void {
    this.#flows = false;
  }

  /** Takes a relay message. `delay`: its delay in transit. */
  message(nowMs: number, delay: Delay, message: Told): void {
    switch (message.type) {
      case 'status':
        this.#status(nowMs, delay, message);
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

  frame(nowMs: number, delay: Delay, bytes: Uint8Array): void {
    let frame: Frame;
    try {
      frame = this.#decoder.decode(bytes);
    } catch (error) {
      // An unreadable frame is skipped: the relay sends its base, and the next KEY needs none.
      if (error instanceof FrameError) return;
      throw error;
    }
    const { schema, seq, codes } = frame;
    // A KEY older than the relay's newest frame is only a base for later frames, not news about the robot.
    if (bytes[0] === TAG_KEY && seq < (this.#told?.seq ?? 0)) return;
    const leftMs = nowMs - delay.leastMs;
    const writtenMs = nowMs - delay.mostMs;
    const before = this.#newest;
    const sameSchema = before !== null && before.schemaId === schema.id;
    const unsure = !sameSchema || leftMs - before.leftMs > GAP_MS;
    if (unsure || poseDiffers(schema, before.codes, codes)) this.#changedMs = nowMs;
    const told = this.#told;
    const fresh = this.#flows && told !== null && seq > told.seq;
    this.#flows = true;
    if (fresh) this.#freshMs = writtenMs;
    this.#show(schema); // it may be one that was shown earlier
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
        bornMs: fresh ? writtenMs : told?.seq === seq ? told.bornMs : null,
        changedMs: this.#changedMs,
        atMs: nowMs,
        lateMs: delay.leastMs,
        transitMs: delay.mostMs,
      },
    });
  }

  #status(nowMs: number, delay: Delay, status: Extract<Told, { type: 'status' }>): void {
    const leftMs = nowMs - delay.leastMs;
    const atMs = nowMs - delay.mostMs;
    const { seq, age_ms } = status;
    this.#told = seq === null ? null : { seq, bornMs: age_ms === null ? null : atMs - age_ms };
    // The age was correct when the status left the relay. A frame that is already here is at least as old as its time here.
    const heldMs = this.#newest?.seq === status.seq ? leftMs - this.#newest.leftMs : 0;
    this.#post({
      kind: 'status',
      status: {
        robot: status.robot,
        ageMs: status.age_ms === null ? null : Math.max(status.age_ms, heldMs),
        seq: status.seq,
        degraded: status.degraded,
        overShare: status.over_share,
        atMs,
        heardMs: leftMs,
        transitMs: delay.mostMs,
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
