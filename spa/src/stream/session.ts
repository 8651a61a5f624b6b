import {
  type Bye,
  Close,
  type Hello,
  parseRelayMessage,
  type RateGranted,
  type RelayMessage,
  retryOf,
  type ViewerMessage,
  WIRE_VERSION,
} from '@posecast/wire';
import { HELD_UP_MS, QUIET_AFTER_MS, STALE_AFTER_MS } from '../twin/liveness.ts';
import { FrameReader } from './frame_reader.ts';
import { type Delay, Lateness, lowerHz, Silence } from './lateness.ts';
import type { Action, Ending, FromStream, Phase } from './messages.ts';
import { Acknowledgements, RateWish, RoundTrip, retryDelayMs, WAIT_S } from './pacing.ts';
import { type Transport, TransportChoice } from './transport.ts';

/** Reasons for a rate that the page need not explain. */
const AS_WISHED = new Set(['', 'asked', 'recovered']);
const SLOW_NETWORK = 'slow network';

/** The posts for a hello. `isSlowed`: the requested rate is lower than wanted, because the network is slow. */
function helloPosts({ wire, hz, model, limits }: Hello, isSlowed: boolean): FromStream[] {
  const delayS = limits.get('delay_s') ?? 0;
  const posts: FromStream[] = [
    { kind: 'rate', hz, reason: isSlowed ? SLOW_NETWORK : null },
    { kind: 'model', hash: model },
    { kind: 'behind', ms: delayS > 0 ? 1000 * delayS : null },
  ];
  if (wire !== WIRE_VERSION) posts.push({ kind: 'problem', problem: { what: 'newer', detail: `${wire}` } });
  return posts;
}

function ratePost({ hz, reason }: RateGranted): FromStream {
  return { kind: 'rate', hz, reason: AS_WISHED.has(reason) ? null : reason };
}

/** A status arrives at least once a second: if three are missing, the socket is dead although it did not close. */
export const SILENT_LIMIT_MS = 3000;
/** A connection that has not opened within this time has failed. */
export const CONNECT_LIMIT_MS = 8000;
const PACE_EVERY_MS = 1000;
/** On events, the relay's clock is asked for by separate requests, with random times between these in between, so that a crowd
 *  does not ask at once. */
const ASK_CLOCK_MS = { least: 10_000, most: 30_000 } as const;
/** A slower answer may have had to open a connection. It is asked for once more, on the same one. */
const SLOW_ANSWER_MS = 500;
/** After a connection has lasted this long, the next failure starts the backoff from the beginning. */
const WORKED_MS = 5000;

/**
 * One viewer's connection to one robot as a pure state machine, without a socket, a timer or a clock: each method takes an event
 * and its time (ms of the viewer's clock) and returns the actions to perform.
 *
 * connecting ──opened──► open ──closed, silent──► waiting ──time, wake──► connecting
 *        └──failed, slow──────────────────────────────┘ open ──closed with a code that says "never"──► ended ──wake──►
 *        connecting
 *
 * `TransportChoice` picks the transport at every connect. Server-sent events are one-way: a different rate needs another
 * connection, and the phase stays `open` meanwhile. A mirror (any address that is not a WebSocket's) has one fixed rate. If a
 * full relay names a lane, the session is `connecting` to it at once; the lane posts its data directly (`lane/`).
 *
 * Over plain HTTP/1.1, a browser opens six connections to a host, for all its tabs and frames. So a page that nobody sees gives
 * its event stream, or its mirror's, back: it is `waiting`, without a time, until it is seen.
 */
export class Session {
  readonly #url: string;
  #token: string | undefined;
  readonly #lane: string | undefined;
  readonly #wish: RateWish;
  readonly #random: () => number;
  /** Whether anybody can see the page. */
  #seen: boolean;

  #phase: Phase = 'ended';
  #sinceMs = 0;
  #heardMs = 0;
  /** When this thread last ran, to tell whether it slept. */
  #aliveMs = 0;
  readonly #silence = new Silence();
  #retryAtMs: number | null = null;
  #failures = 0;
  #bye: Bye | null = null;
  /** The relay is being replaced, another one is starting, and the old one's data is not old yet. */
  #moves = false;
  #laneBye: Bye | undefined;
  #acknowledgements = new Acknowledgements();
  #roundTrip = new RoundTrip();
  #paceMs = 0;
  #askClockAtMs = Number.NEGATIVE_INFINITY;
  #mayRepeat = false;
  /** When a WebSocket was last tried beside the stream. */
  #triedMs = 0;
  readonly #choice: TransportChoice;
  readonly #lateness = new Lateness();
  /** Whether a text message has arrived on this connection. */
  #greeted = false;
  readonly #actions: Action[] = [];
  readonly #post = (message: FromStream) => this.#actions.push({ do: 'post', message });
  #reading = new FrameReader(this.#post, 0);

  /** `lane`: where viewers without a token read the robot's past instead. */
  constructor(
    url: string,
    hz: number,
    visible: boolean,
    random: () => number,
    token?: string,
    lane?: string,
  ) {
    this.#url = url;
    this.#token = token;
    this.#lane = lane;
    this.#wish = new RateWish(hz, visible);
    this.#seen = visible;
    this.#random = random;
    this.#choice = new TransportChoice(random, !url.startsWith('ws'));
  }

  get phase(): Phase {
    return this.#phase;
  }

  get moves(): boolean {
    return this.#moves;
  }

  start(nowMs: number): Action[] {
    this.#connect(nowMs);
    return this.#take();
  }

  opened(nowMs: number): Action[] {
    const stoodMs = nowMs - this.#aliveMs;
    if (stoodMs > STALE_AFTER_MS && this.#onEvents) {
      this.#connect(nowMs); // the thread slept: the age of messages that arrived meanwhile is unknown
      return this.#take();
    }
    this.#phase = 'open';
    this.#sinceMs = nowMs;
    this.#moves &&= nowMs - this.#heardMs < STALE_AFTER_MS;
    this.#heardMs = nowMs - (stoodMs > STALE_AFTER_MS ? stoodMs : 0);
    this.#roundTrip = new RoundTrip(); // at once, because the age on the chip needs it
    this.#paceMs = nowMs;
    this.#link(null);
    this.#moves = false;
    if (this.#inLane) this.#choice.recordSuccess();
    if (this.#token && !this.#onEvents) this.#send({ type: 'auth', token: this.#token });
    this.#wishRate(nowMs);
    return this.#take();
  }

  /** The WebSocket tried beside server-sent events or segments was accepted: it now carries the stream. */
  moved(nowMs: number): Action[] {
    this.#choice.now = 'websocket';
    this.#wish.slowHz = null;
    this.#begin(nowMs, this.#wish.wantedHz, this.#triedMs);
    return this.opened(nowMs);
  }

  /** The WebSocket tried beside the stream was refused, with the wait that the relay requested. */
  refused(nowMs: number, retryS: number): void {
    this.#choice.recordRefusal(nowMs, 1000 * retryS);
  }

  /** Bytes arrived on server-sent events, perhaps only part of a message: a long message on a slow connection is not silence. */
  heard(nowMs: number): Action[] {
    this.#hear(nowMs);
    return this.#take();
  }

  /** The next server-sent event was written at `writtenMs` of the relay's own clock. */
  stamped(nowMs: number, writtenMs: number): void {
    this.#lateness.stamped(nowMs, writtenMs);
    this.#silence.endIfWrittenAfter(nowMs - this.#lateness.ms, this.#oldAfterMs);
  }

  text(nowMs: number, text: string): Action[] {
    this.#hear(nowMs);
    if (!this.#greeted) this.#choice.recordSuccess();
    this.#greeted = true;
    const message = parseRelayMessage(text);
    if (message !== null) this.#understand(nowMs, message);
    this.#acknowledge(nowMs);
    return this.#take();
  }

  binary(nowMs: number, frame: Uint8Array): Action[] {
    this.#hear(nowMs);
    this.#acknowledgements.countMessage();
    this.#reading.frame(nowMs, this.#delay(nowMs), frame);
    this.#acknowledge(nowMs);
    return this.#take();
  }

  /** The relay, or another one, has answered `text` to the question of `askedMs` for its clock. */
  clock(nowMs: number, askedMs: number, text: string): Action[] {
    const message = parseRelayMessage(text);
    if (message?.type === 'pong' && message.t === askedMs && message.clock_ms !== null) {
      this.#roundTrip.pong(nowMs, askedMs);
      this.#lateness.answered(nowMs, askedMs, message.clock_ms);
    } // else it is none, or an older one from a cache
    if (this.#mayRepeat && nowMs - askedMs > SLOW_ANSWER_MS && !this.#lateness.isSure(nowMs)) this.#sendAsk();
    this.#mayRepeat = false;
    return this.#take();
  }

  /** The socket closed, or never opened (then the code is the browser's 1006). */
  closed(nowMs: number, code: number, reason: string): Action[] {
    const bye = this.#bye;
    if (bye?.code === Close.FULL && bye.lane) this.#connect(nowMs, bye);
    else this.#lost(nowMs, bye ?? { code, reason });
    return this.#take();
  }

  tick(nowMs: number): Action[] {
    const wasHeldUp = this.#noteAlive(nowMs);
    if (this.#phase === 'open') {
      if (this.#inLane) this.#tryWebSocket(nowMs);
      else if (nowMs - this.#heardMs > SILENT_LIMIT_MS && !wasHeldUp) {
        this.#actions.push({ do: 'drop' });
        this.#lost(nowMs, { code: 4408, reason: 'silent' });
      } else {
        this.#acknowledge(nowMs);
        this.#wishRate(nowMs);
        this.#measure(nowMs);
        if (this.#greeted) this.#tryWebSocket(nowMs);
        if (this.#choice.now === 'events' && this.#wish.askedHz > 0 && this.#lateness.tooLate(nowMs)) {
          this.#wish.slowHz = lowerHz(this.#wish.askedHz);
          this.#reask(nowMs, this.#wish.slowHz); // closing the old connection drops the old poses in transit
        }
      }
    } else if (this.#phase === 'connecting' && this.#choice.isOverdue(nowMs)) {
      this.#choice.recordFailure(nowMs);
      this.#connect(nowMs);
    } else if (this.#phase === 'connecting' && nowMs - this.#sinceMs > CONNECT_LIMIT_MS) {
      this.#actions.push({ do: 'drop' });
      this.#lost(nowMs, { code: 1006, reason: 'no answer' });
    } else if (this.#phase === 'waiting' && this.#retryAtMs !== null && nowMs >= this.#retryAtMs) {
      this.#connect(nowMs);
    }
    return this.#take();
  }

  /** While poses are not `wanted`, none are requested; status and events continue, unless nobody sees the page and they would
   *  take an HTTP connection. */
  visibility(nowMs: number, wanted: boolean, seen = wanted): Action[] {
    this.#wish.visible = wanted;
    this.#seen = seen;
    if (wanted) this.#reading.resumed(nowMs);
    if (seen && this.#isGivenBack) this.#connect(nowMs);
    else if (!seen && this.#holdsAnswer && this.#phase !== 'ended') this.#giveBack();
    else this.#wishRate(nowMs);
    return this.#take();
  }

  /** The page calls its pose old as of `sinceMs`. Data that arrives now may have been in transit since before, even after a
   *  silence too short to be noticed, so it counts as old until the relay has answered. */
  doubt(nowMs: number, sinceMs: number): Action[] {
    if (this.#phase !== 'open' || this.#onEvents) return [];
    this.#silence.begin(Math.min(this.#heardMs, sinceMs));
    this.#ping(nowMs);
    return this.#take();
  }

  /** Back online, back from sleep, or the viewer asks (`isAsked`). A connection that was quiet for half the limit is replaced. */
  wake(nowMs: number, isAsked = false): Action[] {
    this.#choice.retrySoon(nowMs, isAsked);
    if (this.#phase === 'connecting' || (this.#isGivenBack && !this.#seen)) return this.#take();
    if (this.#phase === 'open') {
      if (this.#inLane || nowMs - this.#heardMs <= SILENT_LIMIT_MS / 2) return this.#take();
      this.#actions.push({ do: 'drop' });
    }
    this.#failures = 0;
    this.#connect(nowMs);
    return this.#take();
  }

  /** Takes a new token. A renewed one is sent on the open WebSocket; signing in or out needs a new connection. */
  renew(nowMs: number, token: string | undefined): Action[] {
    const before = this.#token;
    this.#token = token;
    if (before && token && this.#phase === 'open' && !this.#onEvents) this.#send({ type: 'auth', token });
    else if (before !== token && (this.#seen || !this.#isGivenBack)) {
      this.#actions.push({ do: 'drop' });
      this.#failures = 0;
      this.#connect(nowMs);
    }
    return this.#take();
  }

  /** The viewer requests the full rate, whatever the network or the relay lowered it to. */
  wishAll(nowMs: number): Action[] {
    this.#wish.slowHz = null;
    this.#wish.askedHz = Number.NaN;
    this.#wishRate(nowMs);
    return this.#take();
  }

  close(): Action[] {
    this.#phase = 'ended';
    this.#actions.push({ do: 'drop' });
    return this.#take();
  }

  #take(): Action[] {
    return this.#actions.splice(0);
  }

  #send(message: ViewerMessage): void {
    this.#actions.push({ do: 'send', text: JSON.stringify(message) });
  }

  #link(ending: Ending | null): void {
    const [by, phase, retryAtMs] = [this.#choice.now, this.#phase, this.#retryAtMs];
    this.#post({ kind: 'link', by, phase, retryAtMs, ending, moves: this.#moves });
  }

  /** `full`: the relay has no free place; public data is read from the lane that it names, until a WebSocket is accepted. */
  #connect(nowMs: number, full?: Bye): void {
    const asBefore = this.#isGivenBack;
    this.#phase = 'connecting';
    this.#retryAtMs = null;
    this.#laneBye = full;
    const by = full
      ? this.#choice.enterLane(nowMs, 1000 * (full.retry_s ?? WAIT_S))
      : asBefore
        ? this.#choice.now
        : this.#choice.chooseNext(nowMs, this.#lane !== undefined && !this.#token);
    if (!this.#seen && this.#holdsAnswer) {
      this.#giveBack();
      return;
    }
    if (!this.#onEvents) this.#wish.slowHz = null;
    this.#begin(nowMs, by === 'websocket' ? this.#wish.wantedHz : this.#wish.hz);
    this.#link(null);
    const lane = full ? `${full.lane} ${this.#url}` : `${this.#lane}`;
    const url = by === 'segments' ? lane : this.#address(by, this.#wish.askedHz);
    this.#actions.push({ do: 'connect', by, url });
  }

  #giveBack(): void {
    this.#phase = 'waiting';
    this.#retryAtMs = null;
    this.#actions.push({ do: 'drop' });
    this.#link(null);
  }

  get #isGivenBack(): boolean {
    return this.#phase === 'waiting' && this.#retryAtMs === null;
  }

  /** The transport is one answer without end. */
  get #holdsAnswer(): boolean {
    return this.#onEvents && !this.#inLane;
  }

  get #inLane(): boolean {
    return this.#choice.now === 'segments';
  }

  /** The transport is one-way (events, segments or mirror): nothing can be sent to the relay. */
  get #onEvents(): boolean {
    return this.#choice.now !== 'websocket';
  }

  #tryWebSocket(nowMs: number): void {
    if (!this.#choice.shouldTryWebSocket(nowMs)) return;
    this.#triedMs = nowMs;
    this.#actions.push({ do: 'try', url: this.#address('websocket', this.#wish.wantedHz) });
  }

  #address(by: Transport, hz: number): string {
    return streamAddress(this.#url, by, hz, Boolean(this.#token));
  }

  /** Reconnects for a different rate on events. The page is not told: until the new answer arrives, its pose just ages. */
  #reask(nowMs: number, hz: number): void {
    this.#begin(nowMs, hz);
    this.#heardMs = nowMs;
    this.#wish.recordAsked(nowMs, hz);
    this.#actions.push({ do: 'connect', by: 'events', url: this.#address('events', hz) });
  }

  /** `askedMs`: when the connection was requested. */
  #begin(nowMs: number, askedHz: number, askedMs = nowMs): void {
    this.#sinceMs = nowMs;
    this.#aliveMs = nowMs;
    this.#silence.end();
    this.#bye = null;
    this.#greeted = false;
    this.#lateness.begin(nowMs, askedMs);
    // The relay remembers per connection what it has sent: a new one starts from nothing on both sides.
    this.#reading = new FrameReader(this.#post, askedMs);
    this.#acknowledgements = new Acknowledgements();
    this.#wish.askedHz = askedHz;
  }

  #lost(nowMs: number, ended: Ending & { retry_s?: number | null }): void {
    if (this.#phase === 'ended' || this.#phase === 'waiting') return;
    const full = this.#inLane && this.#laneBye;
    // the refusal still holds if the lane that it named has not started; a socket may be granted what a lane later refuses
    const unopened = this.#phase === 'connecting' ? full : null;
    const { code, reason, retry_s } = unopened || (full ? { ...ended, code: 1006 } : ended);
    // asking the successor too early does no harm
    const isMoved = code === Close.DRAIN || (this.#moves && code === 1006);
    this.#moves = isMoved && nowMs - this.#heardMs < STALE_AFTER_MS;
    if (this.#phase === 'open' && nowMs - this.#sinceMs >= WORKED_MS) this.#failures = 0;
    if (!this.#greeted) this.#choice.recordFailure(nowMs);
    const delayMs = retryDelayMs(retryOf(code), this.#failures++, this.#random(), retry_s ?? null);
    this.#phase = delayMs === null ? 'ended' : 'waiting';
    this.#retryAtMs = delayMs === null ? null : nowMs + delayMs;
    this.#link({ code, reason });
  }

  #understand(nowMs: number, message: RelayMessage): void {
    switch (message.type) {
      case 'hello':
        for (const post of helloPosts(message, this.#wish.slowHz !== null)) this.#post(post);
        return;
      case 'rate':
        this.#post(ratePost(message));
        return;
      case 'pong':
        if (this.#roundTrip.pong(nowMs, message.t)) this.#silence.end(); // the pong arrived after all of the backlog
        this.#lateness.answered(nowMs, message.t, message.clock_ms);
        if (message.clock_ms !== null) this.#lateness.stamped(nowMs, message.clock_ms);
        return;
      case 'bye':
        this.#bye = message;
        return;
      default:
        if (message.type === 'status' && message.clock_ms !== null && !this.#onEvents)
          this.#lateness.stamped(nowMs, message.clock_ms);
        this.#reading.message(nowMs, this.#delay(nowMs), message);
    }
  }

  /** Something arrived: records whether there was a silence before it. Such a silence ends with the answer to a ping, or on
   *  events with an event that was written late enough. In a mirror, silence is normal and not counted. */
  #hear(nowMs: number): void {
    this.#noteAlive(nowMs);
    if (nowMs - this.#heardMs > this.#oldAfterMs && this.#choice.now !== 'mirror') {
      this.#silence.begin(this.#heardMs);
      if (!this.#onEvents) this.#ping(nowMs);
    }
    this.#heardMs = nowMs;
  }

  /** Records that this thread runs. Returns whether it did not for a while: what arrived meanwhile is still to be read. */
  #noteAlive(nowMs: number): boolean {
    const beforeMs = this.#aliveMs;
    this.#aliveMs = nowMs;
    const wasHeldUp = this.#phase === 'open' && nowMs - beforeMs > HELD_UP_MS;
    if (wasHeldUp) this.#post({ kind: 'held-up', fromMs: beforeMs, toMs: nowMs });
    return wasHeldUp;
  }

  get #oldAfterMs(): number {
    return this.#wish.visible ? STALE_AFTER_MS : QUIET_AFTER_MS;
  }

  /** The delay of data that arrives now. The least one is only measured for events: on a WebSocket, the relay waits for
   *  acknowledgements long before it runs late. A mirror cannot be asked, so the most is unknown and left out. */
  #delay(nowMs: number): Delay {
    const leastMs = Math.max(this.#onEvents ? this.#lateness.ms : 0, this.#silence.ageMs(nowMs));
    const mostMs = this.#choice.now === 'mirror' ? 0 : this.#lateness.mostMs(nowMs);
    return { leastMs, mostMs: Math.max(leastMs, mostMs) };
  }

  #ping(nowMs: number): void {
    this.#send(this.#roundTrip.ping(nowMs));
  }

  #acknowledge(nowMs: number): void {
    if (this.#phase !== 'open' || this.#onEvents) return;
    const n = this.#acknowledgements.takeDue(nowMs, this.#roundTrip.ms);
    if (n !== null) this.#send({ type: 'ack', n });
  }

  #wishRate(nowMs: number): void {
    if (this.#choice.now === 'mirror' || this.#inLane || this.#phase !== 'open') return;
    if (!this.#wish.isDue(nowMs, this.#onEvents)) return;
    const { hz } = this.#wish;
    if (this.#onEvents) {
      this.#reask(nowMs, hz);
      return;
    }
    this.#wish.recordAsked(nowMs, hz);
    this.#send({ type: 'rate', hz });
  }

  #measure(nowMs: number): void {
    if (!this.#onEvents && this.#roundTrip.isDue(nowMs)) this.#ping(nowMs);
    if (this.#choice.now === 'events' && this.#greeted) this.#askClock(nowMs);
    if (nowMs - this.#paceMs < PACE_EVERY_MS) return;
    this.#paceMs = nowMs;
    const lateMs = this.#choice.now === 'mirror' ? null : this.#lateness.knownMs;
    this.#post({ kind: 'pace', hz: this.#reading.hz(nowMs), roundTripMs: this.#roundTrip.ms, lateMs });
  }

  #askClock(nowMs: number): void {
    if (!this.#wish.visible || nowMs < this.#askClockAtMs || this.#lateness.isSure(nowMs)) return;
    const { least, most } = ASK_CLOCK_MS;
    this.#askClockAtMs = nowMs + least + this.#random() * (most - least);
    this.#mayRepeat = true;
    this.#sendAsk();
  }

  #sendAsk(): void {
    this.#actions.push({ do: 'ask', url: pingAddress(this.#url) });
  }
}

/** The address to connect to for a rate. `url`: the stream's own; for events the token goes in a header, and for segments none is
 *  sent. */
function streamAddress(url: string, by: Transport, hz: number, hasToken: boolean): string {
  if (by === 'mirror') return url;
  if (by === 'events') return `${url.replace(/^ws/, 'http')}.sse?hz=${hz}`;
  return `${url}?hz=${hz}${hasToken ? '&auth=1' : ''}`;
}

/** The address that answers with the clock of the relay that sends the stream at `url`. */
function pingAddress(url: string): string {
  return new URL('../../ping', url.replace(/^ws/, 'http')).href;
}
