import {
  Decoder,
  type Frame,
  FrameError,
  parseRelayMessage,
  type RelayMessage,
  retryOf,
  type Schema,
  SchemaError,
  type ViewerMessage,
  WIRE_VERSION,
} from '@posecast/wire';
import { poseDiffers } from '../twin/motion.ts';
import { retryDelayMs } from './backoff.ts';
import type { Ending, FromStream, Phase } from './messages.ts';

/** status comes at least once a second: three of them missing is a dead socket that nobody told us about. */
export const SILENT_LIMIT_MS = 3000;
export const CONNECT_LIMIT_MS = 8000;
const ACK_EVERY_MS = 1000;
const PING_EVERY_MS = 5000;
const PACE_EVERY_MS = 1000;
/** Between two rate wishes, so that a person flipping through tabs is no flood. */
const RATE_EVERY_MS = 500;
/** A connection that stood this long worked: the next failure starts the backoff anew. */
const WORKED_MS = 5000;
/** After a longer pause between frames nobody knows whether the pose moved meanwhile. */
const GAP_MS = 2500;

/** What the worker must do, in this order. */
export type Action =
  | { do: 'connect'; url: string }
  | { do: 'send'; text: string }
  | { do: 'drop' }
  | { do: 'post'; message: FromStream };

/**
 * One viewer's connection to one robot, without a socket, a timer or a clock: what happened and when goes in, what to
 * do comes out.
 *
 *   connecting ──opened──► open ──closed, silent──► waiting ──time, wake──► connecting
 *        └──failed, slow──────────────────────────────┘
 *   open ──closed with a code that says "not again"──► ended ──wake──► connecting
 */
export class Session {
  readonly #url: string;
  readonly #wantedHz: number;
  readonly #random: () => number;

  #phase: Phase = 'ended';
  #sinceMs = 0;
  #heardMs = 0;
  #retryAtMs: number | null = null;
  #failures = 0;
  #bye: (Ending & { retryS: number | null }) | null = null;
  #visible = true;

  #decoder = new Decoder();
  #shownSchemaId: number | null = null;
  #statusSeq: number | null = null;
  #freshMs: number | null = null;
  #changedMs = 0;
  #newest: { schemaId: number; seq: number; codes: Int32Array; atMs: number } | null = null;

  #received = 0;
  #acknowledged = 0;
  #ackMs = Number.NEGATIVE_INFINITY;
  #pingMs = Number.NEGATIVE_INFINITY;
  #roundTripMs: number | null = null;
  #askedHz: number;
  #askedMs = Number.NEGATIVE_INFINITY;
  #paceMs = 0;
  #frames: number[] = [];

  #actions: Action[] = [];

  constructor(url: string, hz: number, visible: boolean, random: () => number) {
    this.#url = url;
    this.#wantedHz = hz;
    this.#askedHz = hz;
    this.#visible = visible;
    this.#random = random;
  }

  get phase(): Phase {
    return this.#phase;
  }

  start(nowMs: number): Action[] {
    this.#connect(nowMs);
    return this.#take();
  }

  opened(nowMs: number): Action[] {
    this.#phase = 'open';
    this.#sinceMs = nowMs;
    this.#heardMs = nowMs;
    this.#pingMs = Number.NEGATIVE_INFINITY; // at once: the age on the chip needs it
    this.#paceMs = nowMs;
    this.#link(null);
    this.#wishRate(nowMs);
    return this.#take();
  }

  text(nowMs: number, text: string): Action[] {
    this.#heardMs = nowMs;
    const message = parseRelayMessage(text);
    if (message !== null) this.#understand(nowMs, message);
    this.#acknowledge(nowMs);
    return this.#take();
  }

  binary(nowMs: number, frame: Uint8Array): Action[] {
    this.#heardMs = nowMs;
    this.#received += 1;
    this.#decode(nowMs, frame);
    this.#acknowledge(nowMs);
    return this.#take();
  }

  /** The socket closed, or never opened (then the code is the browser's 1006). */
  closed(nowMs: number, code: number, reason: string): Action[] {
    const ending: Ending = this.#bye ?? { code, reason };
    this.#lost(nowMs, ending, this.#bye?.retryS ?? null);
    return this.#take();
  }

  tick(nowMs: number): Action[] {
    if (this.#phase === 'open') {
      if (nowMs - this.#heardMs > SILENT_LIMIT_MS) {
        this.#actions.push({ do: 'drop' });
        this.#lost(nowMs, { code: 4408, reason: 'silent' }, null);
      } else {
        this.#acknowledge(nowMs);
        this.#wishRate(nowMs);
        this.#measure(nowMs);
      }
    } else if (this.#phase === 'connecting' && nowMs - this.#sinceMs > CONNECT_LIMIT_MS) {
      this.#actions.push({ do: 'drop' });
      this.#lost(nowMs, { code: 1006, reason: 'no answer' }, null);
    } else if (this.#phase === 'waiting' && this.#retryAtMs !== null && nowMs >= this.#retryAtMs) {
      this.#connect(nowMs);
    }
    return this.#take();
  }

  /** A hidden page asks for no poses at all; status and events keep coming. */
  visibility(nowMs: number, visible: boolean): Action[] {
    this.#visible = visible;
    this.#wishRate(nowMs);
    return this.#take();
  }

  /** Back online, back from sleep, or the person asks. A socket that may have died in the meantime is not trusted. */
  wake(nowMs: number): Action[] {
    if (this.#phase === 'connecting') return this.#take();
    if (this.#phase === 'open') {
      if (nowMs - this.#heardMs <= SILENT_LIMIT_MS / 2) return this.#take();
      this.#actions.push({ do: 'drop' });
    }
    this.#failures = 0;
    this.#connect(nowMs);
    return this.#take();
  }

  close(): Action[] {
    this.#phase = 'ended';
    this.#actions.push({ do: 'drop' });
    return this.#take();
  }

  #take(): Action[] {
    const actions = this.#actions;
    this.#actions = [];
    return actions;
  }

  #post(message: FromStream): void {
    this.#actions.push({ do: 'post', message });
  }

  #send(message: ViewerMessage): void {
    this.#actions.push({ do: 'send', text: JSON.stringify(message) });
  }

  #link(ending: Ending | null): void {
    this.#post({ kind: 'link', phase: this.#phase, retryAtMs: this.#retryAtMs, ending });
  }

  #connect(nowMs: number): void {
    this.#phase = 'connecting';
    this.#sinceMs = nowMs;
    this.#retryAtMs = null;
    this.#bye = null;
    // The relay keeps per connection what we were given: a new one starts from nothing on both sides.
    this.#decoder = new Decoder();
    this.#shownSchemaId = null;
    this.#newest = null;
    this.#statusSeq = null;
    this.#freshMs = null;
    this.#received = 0;
    this.#acknowledged = 0;
    this.#ackMs = Number.NEGATIVE_INFINITY;
    this.#roundTripMs = null;
    this.#askedHz = this.#wantedHz;
    this.#frames = [];
    this.#link(null);
    this.#actions.push({ do: 'connect', url: `${this.#url}?hz=${this.#wantedHz}` });
  }

  #lost(nowMs: number, ending: Ending, retryS: number | null): void {
    if (this.#phase === 'ended' || this.#phase === 'waiting') return;
    if (this.#phase === 'open' && nowMs - this.#sinceMs >= WORKED_MS) this.#failures = 0;
    const delayMs = retryDelayMs(retryOf(ending.code), this.#failures, this.#random(), retryS);
    this.#failures += 1;
    this.#phase = delayMs === null ? 'ended' : 'waiting';
    this.#retryAtMs = delayMs === null ? null : nowMs + delayMs;
    this.#link(ending);
  }

  #understand(nowMs: number, message: RelayMessage): void {
    switch (message.type) {
      case 'hello':
        if (message.wire !== WIRE_VERSION) {
          this.#post({
            kind: 'problem',
            text: 'The relay speaks a newer language than this page. Reload it.',
          });
        }
        this.#post({ kind: 'rate', hz: message.hz, reason: null });
        this.#post({ kind: 'model', hash: message.model });
        return;
      case 'status':
        this.#statusSeq = message.seq;
        this.#post({
          kind: 'status',
          status: {
            robot: message.robot,
            ageMs: message.age_ms,
            seq: message.seq,
            degraded: message.degraded,
            atMs: nowMs,
          },
        });
        return;
      case 'schema':
        this.#adoptSchema(message.text);
        return;
      case 'info':
        this.#post({ kind: 'info', kv: message.kv });
        return;
      case 'event':
        this.#post({ kind: 'event', event: message });
        return;
      case 'rate':
        this.#post({ kind: 'rate', hz: message.hz, reason: message.reason || null });
        return;
      case 'model':
        this.#post({ kind: 'model', hash: message.hash });
        return;
      case 'pong':
        this.#roundTripMs = Math.max(0, nowMs - message.t);
        return;
      case 'bye':
        this.#bye = { code: message.code, reason: message.reason, retryS: message.retry_s };
        return;
    }
  }

  #adoptSchema(text: string): void {
    let schema: Schema;
    try {
      schema = this.#decoder.addSchema(text);
    } catch (error) {
      if (!(error instanceof SchemaError)) throw error;
      this.#post({ kind: 'problem', text: `The robot's description can't be read: ${error.message}` });
      return;
    }
    this.#showSchema(schema);
  }

  #showSchema(schema: Schema): void {
    if (schema.id === this.#shownSchemaId) return;
    this.#shownSchemaId = schema.id;
    this.#post({ kind: 'schema', text: schema.text });
  }

  #decode(nowMs: number, bytes: Uint8Array): void {
    let frame: Frame;
    try {
      frame = this.#decoder.decode(bytes);
    } catch (error) {
      // A frame we can't read changes nothing: the relay brings its base, and at the latest the next KEY mends it.
      if (error instanceof FrameError) return;
      throw error;
    }
    const { schema, seq, codes } = frame;
    const before = this.#newest;
    const sameSchema = before !== null && before.schemaId === schema.id;
    const unsure = !sameSchema || nowMs - before.atMs > GAP_MS;
    if (unsure || poseDiffers(schema, before.codes, codes)) this.#changedMs = nowMs;
    if (this.#statusSeq !== null && seq > this.#statusSeq) this.#freshMs = nowMs;
    this.#showSchema(schema); // it may be one that was shown before the last
    this.#newest = { schemaId: schema.id, seq, codes, atMs: nowMs };
    this.#frames.push(nowMs);
    this.#post({
      kind: 'state',
      state: {
        schemaId: schema.id,
        seq,
        tS: frame.tS,
        codes: codes.slice(),
        freshMs: this.#freshMs,
        changedMs: this.#changedMs,
        atMs: nowMs,
      },
    });
  }

  /** `n` counts the binary messages of this connection; at most once a second, and never left owing. */
  #acknowledge(nowMs: number): void {
    if (this.#phase !== 'open' || this.#received === this.#acknowledged) return;
    if (nowMs - this.#ackMs < ACK_EVERY_MS) return;
    this.#ackMs = nowMs;
    this.#acknowledged = this.#received;
    this.#send({ type: 'ack', n: this.#received });
  }

  #wishRate(nowMs: number): void {
    const hz = this.#visible ? this.#wantedHz : 0;
    if (this.#phase !== 'open' || hz === this.#askedHz || nowMs - this.#askedMs < RATE_EVERY_MS) return;
    this.#askedHz = hz;
    this.#askedMs = nowMs;
    this.#send({ type: 'rate', hz });
  }

  #measure(nowMs: number): void {
    if (nowMs - this.#pingMs >= PING_EVERY_MS) {
      this.#pingMs = nowMs;
      this.#send({ type: 'ping', t: nowMs });
    }
    if (nowMs - this.#paceMs < PACE_EVERY_MS) return;
    this.#paceMs = nowMs;
    this.#frames = this.#frames.filter((atMs) => nowMs - atMs <= 2 * PACE_EVERY_MS);
    const first = this.#frames[0];
    const last = this.#frames.at(-1);
    const hz =
      first === undefined || last === undefined || last <= first
        ? 0
        : ((this.#frames.length - 1) * 1000) / (last - first);
    this.#post({ kind: 'pace', hz, roundTripMs: this.#roundTripMs });
  }
}
