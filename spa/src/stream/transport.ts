/** What carries a stream: a WebSocket; server-sent events over plain HTTP, where no WebSocket gets through; or a copy
 *  of the relay's data in a database (`mirror`); or what the relay has just recorded, part by part, which any HTTP cache
 *  may hold for everybody (`segments`). */
export type Transport = 'websocket' | 'events' | 'mirror' | 'segments';

/** After this many failed openings, or this long without a working WebSocket, the stream is asked for over plain HTTP.
 *  */
export const FAILED_OPENINGS = 2;
export const WITHOUT_MS = 5000;
/** While on events, a WebSocket is tried at once, then at intervals that double from the first to the second. */
const TRY_AGAIN_MS = 30_000;
const SELDOM_MS = 300_000;
/** Where the lane that the page was told does not work the relay is tried: after random(0 … this), so that a crowd whose cache has
 *  gone does not come at once. */
const WITHOUT_LANE_MS = 30_000;

/** Which transport the next connection takes, and when a stream on server-sent events or in segments tries a WebSocket beside
 *  them.
 *  Pure: without a socket or a clock. */
export class TransportChoice {
  /** The transport of the newest connection. A mirror never changes to another. */
  now: Transport;
  readonly #random: () => number;
  #failed = 0;
  #eventsWork = false;
  /** Since when no WebSocket has worked; null while one does. */
  #withoutMs: number | null = null;
  #deadlineMs = 0;
  #tryAtMs = 0;
  #tryAgainMs = TRY_AGAIN_MS;
  /** From when on the relay is tried instead of the lane that the page was told; null: that works, or has not been tried. */
  #relayAtMs: number | null = null;
  #isAsked = false;

  constructor(random: () => number, mirrored = false) {
    this.#random = random;
    this.now = mirrored ? 'mirror' : 'websocket';
  }

  /** Chooses the transport for a new connection. After failed WebSockets the two transports take turns until one works.
   *  `inLane`: this viewer reads segments, and no WebSocket is tried beside them, nor instead of them while they come. */
  chooseNext(nowMs: number, inLane = false): Transport {
    if (inLane && nowMs < (this.#relayAtMs ?? Number.POSITIVE_INFINITY))
      return this.enterLane(Number.POSITIVE_INFINITY, 0);
    if (this.now === 'mirror') return this.now;
    this.#withoutMs ??= nowMs;
    const endMs = this.#withoutMs + WITHOUT_MS;
    const doubted = this.#failed >= FAILED_OPENINGS || nowMs >= endMs;
    this.now = doubted && (this.now === 'websocket' || this.#eventsWork) ? 'events' : 'websocket';
    this.#deadlineMs = nowMs < endMs ? endMs : nowMs + WITHOUT_MS;
    this.#tryAtMs = nowMs;
    this.#tryAgainMs = TRY_AGAIN_MS; // a relay that was only away for a moment takes WebSockets again
    return this.now;
  }

  /** The relay is full, so segments are read. A WebSocket is tried after one to two times `retryMs`; then when a refusal says, else
   *  ever more seldom. */
  enterLane(nowMs: number, retryMs: number): Transport {
    this.now = 'segments';
    this.recordRefusal(nowMs, retryMs);
    return this.now;
  }

  /** The WebSocket that was tried beside was refused. The relay says when another is worth it: later, the more viewers ask. */
  recordRefusal(nowMs: number, retryMs: number): void {
    this.#tryAgainMs = retryMs;
    this.#tryAtMs = nowMs + retryMs * (1 + this.#random());
  }

  /** Whether an opening WebSocket has taken so long that events should be tried instead. */
  isOverdue(nowMs: number): boolean {
    return this.now === 'websocket' && nowMs >= this.#deadlineMs;
  }

  /** The newest connection ended before the relay said anything on it. */
  recordFailure(nowMs: number): void {
    if (this.now === 'websocket') {
      this.#failed += 1;
      if (this.#isAsked) this.#relayAtMs = null;
      this.#isAsked = false;
    } else if (this.now === 'segments') this.#relayAtMs ??= nowMs + this.#random() * WITHOUT_LANE_MS;
    else {
      this.#eventsWork = false;
      this.#relayAtMs = null; // nothing gets to the relay: the lane again
    }
  }

  /** The relay has said something on the newest connection, or its lane has. */
  recordSuccess(): void {
    this.#relayAtMs = null;
    if (this.now === 'segments') return;
    this.#eventsWork = this.now === 'events';
    if (this.#eventsWork) return;
    this.#failed = 0;
    this.#withoutMs = null;
  }

  /** Something has changed outside (back online, back from sleep): a WebSocket is tried at once. `isAsked`: the person wants it, so
   *  that it is tried instead of a lane that has failed, too, and the lane again where that fails. */
  retrySoon(nowMs: number, isAsked = false): void {
    if (isAsked && this.#relayAtMs !== null) this.#relayAtMs = nowMs;
    this.#isAsked = isAsked;
    if (this.now === 'segments') return; // a full relay is not asked by everybody at once
    this.#tryAtMs = nowMs;
    this.#tryAgainMs = TRY_AGAIN_MS;
  }

  /** Whether a stream on server-sent events or in segments tries a WebSocket now; if so, the next try is put off. */
  shouldTryWebSocket(nowMs: number): boolean {
    const inLane = this.now === 'segments';
    if (!(inLane || this.now === 'events') || nowMs < this.#tryAtMs) return false;
    // viewers behind one proxy don't try in step
    this.#tryAtMs = nowMs + this.#tryAgainMs * ((inLane ? 1 : 0.5) + this.#random());
    this.#tryAgainMs = Math.max(this.#tryAgainMs, Math.min(SELDOM_MS, 2 * this.#tryAgainMs));
    return true;
  }
}
