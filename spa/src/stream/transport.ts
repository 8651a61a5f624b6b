import { fieldsOf } from '../kit.ts';

/** The transport of a stream: a WebSocket; server-sent events over plain HTTP, if no WebSocket gets through; a copy of the
 *  relay's data in a database (`mirror`); or the relay's newest recorded parts (`segments`), which any HTTP cache can serve to
 *  everyone. */
export type Transport = 'websocket' | 'events' | 'mirror' | 'segments';

/** After this many failed attempts, or this long without a working WebSocket, the stream is requested over plain HTTP. */
export const FAILED_OPENINGS = 2;
export const WITHOUT_MS = 5000;
/** While on events, a WebSocket is tried at once, then at intervals that double from the first to the second value. */
const TRY_AGAIN_MS = 30_000;
const SELDOM_MS = 300_000;
/** If the configured lane does not work, the relay is tried after random(0 … this), so that a crowd whose cache has failed does
 *  not arrive at once. */
const WITHOUT_LANE_MS = 30_000;

/** Decides which transport the next connection uses, and when a stream on server-sent events or segments tries a WebSocket in
 *  parallel. Pure: without a socket or a clock. */
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
  /** When the relay is tried instead of the configured lane; null: the lane works or has not been tried. */
  #relayAtMs: number | null = null;
  #isAsked = false;

  constructor(random: () => number, mirrored = false) {
    this.#random = random;
    this.now = mirrored ? 'mirror' : 'websocket';
  }

  /** Chooses the transport for a new connection. After failed WebSockets, the two transports alternate until one works. `inLane`:
   *  this viewer reads segments; while they arrive, no WebSocket is tried. */
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
    this.#tryAgainMs = TRY_AGAIN_MS; // a relay that was only briefly away accepts WebSockets again
    return this.now;
  }

  /** The relay is full, so segments are read. A WebSocket is tried after one to two times `retryMs`; then when the refusal says,
   *  else at increasing intervals. */
  enterLane(nowMs: number, retryMs: number): Transport {
    this.now = 'segments';
    this.recordRefusal(nowMs, retryMs);
    return this.now;
  }

  /** The WebSocket tried in parallel was refused. The relay says when to try again: the more viewers ask, the later. */
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
      this.#relayAtMs = null; // nothing reaches the relay: use the lane again
    }
  }

  /** The relay, or its lane, has said something on the newest connection. */
  recordSuccess(): void {
    this.#relayAtMs = null;
    if (this.now === 'segments') return;
    this.#eventsWork = this.now === 'events';
    if (this.#eventsWork) return;
    this.#failed = 0;
    this.#withoutMs = null;
  }

  /** Something changed outside (back online, back from sleep): a WebSocket is tried at once. `isAsked`: the viewer wants it, so
   *  it is also tried instead of a failed lane, and the lane is tried again if the WebSocket fails. */
  retrySoon(nowMs: number, isAsked = false): void {
    if (isAsked && this.#relayAtMs !== null) this.#relayAtMs = nowMs;
    this.#isAsked = isAsked;
    if (this.now === 'segments') return; // so that not everybody asks a full relay at once
    this.#tryAtMs = nowMs;
    this.#tryAgainMs = TRY_AGAIN_MS;
  }

  /** Whether a stream on server-sent events or segments tries a WebSocket now; if so, the next try is postponed. */
  shouldTryWebSocket(nowMs: number): boolean {
    const inLane = this.now === 'segments';
    if (!(inLane || this.now === 'events') || nowMs < this.#tryAtMs) return false;
    // viewers behind one proxy don't try in step
    this.#tryAtMs = nowMs + this.#tryAgainMs * ((inLane ? 1 : 0.5) + this.#random());
    this.#tryAgainMs = Math.max(this.#tryAgainMs, Math.min(SELDOM_MS, 2 * this.#tryAgainMs));
    return true;
  }
}

/** A relay sends a status right after its hello. A server that sends more before it is not a relay. */
const HEARD_MAX = 10;

/** No relay requests a longer wait. */
const WAIT_S_MAX = 86_400;

/** Tries a WebSocket in parallel to the running stream. `token` is sent first. `accepted` is called when the relay has accepted
 *  it, with the messages so far; `refused` if it declines, with the seconds until the next try. */
export function tryWebSocket(
  url: string,
  token: string | undefined,
  accepted: (socket: WebSocket, heard: readonly MessageEvent<string | ArrayBuffer>[]) => void,
  refused: (retryS: number) => void,
): WebSocket {
  const tried = new WebSocket(url);
  tried.binaryType = 'arraybuffer';
  const heard: MessageEvent<string | ArrayBuffer>[] = [];
  if (token) tried.onopen = () => tried.send(JSON.stringify({ type: 'auth', token }));
  tried.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
    const { type, retry_s } = membersOf(event.data);
    if (heard.push(event) > HEARD_MAX) tried.close();
    else if (type === 'status')
      accepted(tried, heard); // a relay that refuses sends no status
    else if (type === 'bye' && typeof retry_s === 'number' && retry_s > 0 && retry_s <= WAIT_S_MAX)
      refused(retry_s);
  };
  return tried;
}

function membersOf(data: string | ArrayBuffer): Readonly<Record<string, unknown>> {
  try {
    return fieldsOf(typeof data === 'string' && JSON.parse(data));
  } catch {
    return {};
  }
}
