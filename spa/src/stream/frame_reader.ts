import {
  Decoder,
  type Frame,
  FrameError,
  type RelayMessage,
  type Schema,
  SchemaError,
  TAG_KEY,
} from '@posecast/wire';
import type { Delay } from './lateness.ts';
import type { FromStream } from './messages.ts';
import { RateMeter } from './pacing.ts';

/** After a longer pause between frames, the pose may have moved meanwhile, so it counts as changed. */
const GAP_MS = 2500;

/** Decodes frames one after another, and tells when the pose last changed. */
export class PoseDecoder {
  readonly #decoder = new Decoder();
  #newest: { readonly schema: Schema; readonly codes: Int32Array; readonly leftMs: number } | null = null;
  /** When the pose last changed. */
  changedMs = 0;

  /** Takes a schema's text. Returns what is wrong with it, if anything. */
  addSchema(text: string): Schema | string {
    try {
      return this.#decoder.addSchema(text);
    } catch (error) {
      if (error instanceof SchemaError) return error.message;
      throw error;
    }
  }

  /** null for an unreadable frame, which is skipped: no later KEY needs it. */
  decode(bytes: Uint8Array): Frame | null {
    try {
      return this.#decoder.decode(bytes);
    } catch (error) {
      if (error instanceof FrameError) return null;
      throw error;
    }
  }

  /** Records a frame that is to be shown. `leftMs`: when it left the relay, at the latest. */
  record({ schema, codes }: Frame, leftMs: number, nowMs: number): void {
    const before = this.#newest;
    const isUnsure = before?.schema.id !== schema.id || leftMs - before.leftMs > GAP_MS;
    if (isUnsure || poseDiffers(schema, before.codes, codes)) this.changedMs = nowMs;
    this.#newest = { schema, codes, leftMs };
  }
}

type Told = Extract<RelayMessage, { type: 'status' | 'schema' | 'info' | 'event' | 'model' }>;

/**
 * Decodes the frames and messages of one connection, and passes the results to the page through `post`. The relay remembers per
 * connection which KEY the viewer has, so create a new reader for each connection.
 */
export class FrameReader {
  readonly #post: (message: FromStream) => void;
  readonly #poses = new PoseDecoder();
  readonly #rate: RateMeter;
  #shownSchemaId: number | null = null;
  /** The newest frame that the relay's status named, and when it was new (null if the relay does not know). */
  #told: { seq: number; bornMs: number | null } | null = null;
  #freshMs: number | null = null;
  /** Whether frames arrive without a break. False after a pause: the relay may have had the next frame for a while. */
  #flows = true;
  #newest: { readonly seq: number; readonly leftMs: number } | null = null;

  /** `askedMs`: when the connection was requested. */
  constructor(post: (message: FromStream) => void, askedMs: number) {
    this.#post = post;
    this.#rate = new RateMeter(askedMs);
  }

  /** Frames per second over the last two seconds. */
  hz(nowMs: number): number {
    return this.#rate.hz(nowMs);
  }

  /** Poses are requested again after a pause: the next one may be as old as the newest status. */
  resumed(nowMs: number): void {
    this.#flows = false;
    this.#rate.restart(nowMs);
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
    const frame = this.#poses.decode(bytes);
    if (frame === null) return;
    const { schema, seq, codes } = frame;
    // A KEY older than the relay's newest frame is only a base for later frames, not news about the robot.
    if (bytes[0] === TAG_KEY && seq < (this.#told?.seq ?? 0)) return;
    const leftMs = nowMs - delay.leastMs;
    const writtenMs = nowMs - delay.mostMs;
    this.#poses.record(frame, leftMs, nowMs);
    const told = this.#told;
    const fresh = this.#flows && told !== null && seq > told.seq;
    this.#flows = true;
    if (fresh) this.#freshMs = writtenMs;
    this.#show(schema); // it may be one that was shown earlier
    this.#newest = { seq, leftMs };
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
        changedMs: this.#poses.changedMs,
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
    const schema = this.#poses.addSchema(text);
    if (typeof schema === 'string')
      this.#post({ kind: 'problem', problem: { what: 'schema', detail: schema } });
    else this.#show(schema);
  }

  #show(schema: Schema): void {
    if (schema.id === this.#shownSchemaId) return;
    this.#shownSchemaId = schema.id;
    this.#post({ kind: 'schema', schema });
  }
}

/** The fields that define a pose: while none of them changes, the robot is holding still. */
const POSE_FIELDS = ['pos', 'ref', 'flags'] as const;

/** Whether two frames' codes show different poses. Codes are compared exactly: a robot at rest keeps sending the same
 *  codes. */
export function poseDiffers(schema: Schema, before: Int32Array, after: Int32Array): boolean {
  let any = false;
  for (const name of POSE_FIELDS) {
    const field = schema.field(name);
    if (field === null) continue;
    any = true;
    for (let i = field.start; i < field.start + field.size; i++) if (before[i] !== after[i]) return true;
  }
  if (any) return false;
  return before.some((code, i) => code !== after[i]); // a robot without joints: everything counts
}

/** Identifies a frame if its run is not sent. */
interface FrameMark {
  readonly seq: number;
  readonly tS: number;
}

/** The maximum lag of another relay behind the one that showed the newest frame, s; anything later is not live or belongs to
 *  another run. */
const LAG_S = 1.5;

/** Skips the first frames of a socket if a lane, another transport or another relay has already shown them or a newer one. */
export class Overlap {
  #shown: FrameMark | null = null;

  /** `shown`: the newest shown frame. */
  begin(shown: FrameMark | null): void {
    this.#shown = shown;
  }

  /** Whether this frame, or a newer one of the same run, was already shown. The first frame that was not ends the overlap. */
  isShown({ seq, tS }: FrameMark): boolean {
    const shown = this.#shown;
    if (shown !== null) {
      if (seq === shown.seq && tS === shown.tS) return true;
      if (seq < shown.seq && tS < shown.tS && shown.tS - tS < LAG_S) return true;
    }
    this.#shown = null;
    return false;
  }
}

/**
 * A slot for one item between the worker and the page. While the page is busy with the last item, a newer item replaces the
 * waiting one, because an old pose is worthless.
 */
export class Mailbox<T> {
  #waiting: T | null = null;
  #busy = false;
  /** How many items were replaced before delivery. */
  replaced = 0;

  /** Adds an item. Returns what to hand over now, if anything. */
  put(item: T): T | null {
    if (!this.#busy) {
      this.#busy = true;
      return item;
    }
    if (this.#waiting !== null) this.replaced += 1;
    this.#waiting = item;
    return null;
  }

  /** The other side is ready again. Returns what to hand over now, if anything. */
  taken(): T | null {
    const next = this.#waiting;
    this.#waiting = null;
    this.#busy = next !== null;
    return next;
  }

  /** Drops the waiting item. */
  clear(): void {
    this.#waiting = null;
  }
}
