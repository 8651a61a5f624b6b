import { Encoder } from '@posecast/wire';
import type { Action, FromStream } from '../../src/stream/messages.ts';
import { Session } from '../../src/stream/session.ts';
import { HOLDING_AFTER_MS, isClaim, judge, STALE_AFTER_MS, type Word } from '../../src/twin/liveness.ts';
import { RobotTwin } from '../../src/twin/robot.ts';
import { clockMs, type Held, Relay } from './outage_relay.ts';
import { codesWith, SCHEMA, SCHEMA_TEXT } from './schema.ts';

/**
 * A robot whose pose encodes the time, its edge, a relay, a network and a page's stream, with a simulated clock: the input is
 * what breaks and when, the output is the page's false claims. The page's part is the real code.
 */

export const FAULTS = [
  'source silent',
  'uplink cut',
  'edge restarted',
  'link frozen',
  'link cut',
  'link late',
  'relay restarted',
  'page stalled',
  'page hidden',
  'robot stands',
] as const;
export interface Fault {
  what: (typeof FAULTS)[number];
  atMs: number;
  forMs: number;
}

const STEP_MS = 20;
const LINK_MS = 40;
const SAMPLE_MS = 40;
const CONFIRM_MS = 500;
const VIEWER_MS = 100;
const STATUS_MS = 1000;
const TICK_MS = 250;
/** Towards the page, the link's delay grows by this part of the time, to this much. */
const LATER = 0.4;
const LATE_MS = 4000;
/** As many ms of frames as a relay sends without an acknowledgement. */
const BACKLOG_MS = 2000;
/** The resolution of the time in a code, ms. */
const POSE_STEP_MS = 10;
/** From the joint to the page if nothing is broken: sampled, due at the viewer's rate, in transit. */
const ON_ITS_WAY_MS = SAMPLE_MS + VIEWER_MS + LINK_MS + 2 * STEP_MS + POSE_STEP_MS;
const EPOCH_MS = 1_000_000;

type Wire = { text: string } | { frame: Uint8Array };

/** The network between relay and page for one connection. */
class Connection {
  readonly on: 'websocket' | 'events';
  given: { key: Held | null; newest: Held | null } = { key: null, newest: null };
  hz = 1;
  frameMs = 0;
  statusMs = 0;
  /** By the relay. */
  open = false;
  /** By the page. */
  isOpened = false;
  openAtMs: number;
  readonly down: { wire: Wire; atMs: number; writtenMs: number }[] = [];
  readonly up: { text: string; atMs: number }[] = [];
  /** Questions beside the stream for the relay's clock, which are not late. */
  readonly asked: { askedMs: number; atMs: number }[] = [];

  constructor(on: 'websocket' | 'events', openAtMs: number) {
    this.on = on;
    this.openAtMs = openAtMs;
  }
}

export class World {
  nowMs = EPOCH_MS;
  readonly lies: string[] = [];
  readonly words: (Word | null)[] = [];
  readonly #faults: readonly Fault[];
  readonly #carrier: 'websocket' | 'events';
  readonly #session: Session;
  readonly #onItsWayMs: number;
  readonly #twin = new RobotTwin('demo', EPOCH_MS);
  #relay = new Relay();
  #encoder = new Encoder(SCHEMA);
  #seq = 0;
  #run = 1;
  #encodedMs = 0;
  #sentCode = -1;
  /** When the robot reported the code after this one. */
  readonly #outdoneMs = new Map<number, number>();
  #sampleMs = EPOCH_MS;
  #stands: { fromMs: number; toMs: number }[] = [];
  #connection: Connection | null = null;
  #frozenMs: number | null = null;
  #lateSinceMs: number | null = null;
  #tickMs = EPOCH_MS;
  #on = new Set<Fault['what']>();
  #otherwiseMs = Number.NEGATIVE_INFINITY;
  #heardMs = EPOCH_MS;
  /** When the newest noticeable silence ended. */
  #silentUntilMs = EPOCH_MS;
  /** How much longer than usual the newest status was in transit. */
  #statusLateMs = 0;
  /**
   * How much longer than the newest status the shown pose was in transit without a noticed silence. A WebSocket's frames don't say
   * when they were written, and a shorter silence looks like a pause that is LIVE. If the robot's next pose takes long, this one
   * seems that much younger than it is.
   */
  #unseenMs = 0;
  #word: Word | null = null;

  constructor(faults: readonly Fault[], carrier: 'websocket' | 'events', random: () => number) {
    this.#faults = faults;
    this.#carrier = carrier;
    // On events, lateness is learned from those that have arrived: for the first ones it is known only when others follow.
    const stalls = faults.filter(({ what }) => what === 'page stalled').map(({ forMs }) => forMs);
    const unknownMs = carrier === 'events' ? Math.min(STALE_AFTER_MS, Math.max(0, ...stalls)) : 0;
    this.#onItsWayMs = ON_ITS_WAY_MS + unknownMs;
    this.#session = new Session('ws://relay/live', 1000 / VIEWER_MS, true, random);
    this.#twin.acceptWatching(true, EPOCH_MS);
    this.#do(this.#session.start(this.nowMs));
  }

  run(forMs: number): this {
    for (const endMs = this.nowMs + forMs; this.nowMs < endMs; this.nowMs += STEP_MS) this.#step();
    return this;
  }

  /** Runs until nothing breaks any more and the page has made a claim for a while, or for this long. */
  settle(mostMs: number): this {
    const lastMs = Math.max(0, ...this.#faults.map(({ atMs, forMs }) => atMs + forMs));
    this.run(EPOCH_MS + lastMs - this.nowMs);
    this.run(2 * STALE_AFTER_MS); // time needed to notice it
    for (const endMs = this.nowMs + mostMs; this.nowMs < endMs && this.#word !== 'LIVE'; )
      this.run(STATUS_MS);
    return this.run(2 * STALE_AFTER_MS);
  }

  #is(what: Fault['what']): boolean {
    return this.#on.has(what);
  }

  #step(): void {
    const sinceMs = this.nowMs - EPOCH_MS;
    const on = new Set(
      this.#faults.filter(({ atMs, forMs }) => sinceMs >= atMs && sinceMs < atMs + forMs).map((f) => f.what),
    );
    for (const what of FAULTS) if (on.has(what) !== this.#on.has(what)) this.#switch(what, on.has(what));
    this.#on = on;
    this.#robot();
    this.#serve();
    if (this.#is('page stalled')) return;
    this.#deliver();
    while (this.#tickMs <= this.nowMs) {
      this.#tickMs = Math.max(this.#tickMs + TICK_MS, this.nowMs + STEP_MS);
      this.#do(this.#session.tick(this.nowMs));
    }
    this.#look();
  }

  #switch(what: Fault['what'], begins: boolean): void {
    if (begins) this.#on.add(what);
    switch (what) {
      case 'edge restarted': // gone for this long, then a new run
        this.#relay.token = !begins;
        if (!begins) {
          this.#encoder = new Encoder(SCHEMA);
          this.#run += 1;
          this.#seq = 0;
        }
        break;
      case 'relay restarted':
        this.#cut();
        this.#relay = new Relay();
        if (!begins && !this.#is('uplink cut') && !this.#is('edge restarted')) this.#snapshot();
        break;
      case 'uplink cut':
        this.#relay.token = !begins;
        if (!begins) this.#snapshot();
        break;
      case 'link frozen':
        this.#frozenMs = begins ? this.nowMs : null;
        if (!begins) this.#thaw();
        break;
      case 'link late':
        this.#lateSinceMs = begins ? this.nowMs : null;
        break;
      case 'link cut':
        if (begins) this.#cut();
        else this.#do(this.#session.wake(this.nowMs));
        break;
      case 'page hidden':
        this.#do(this.#session.visibility(this.nowMs, !begins));
        this.#twin.acceptWatching(!begins, this.nowMs);
        break;
      case 'robot stands':
        if (begins) this.#stands.push({ fromMs: this.nowMs, toMs: Number.POSITIVE_INFINITY });
        else this.#stands.at(-1)!.toMs = this.nowMs;
        break;
    }
  }

  /** The relay requests the newest frame from the edge; its age is unknown. */
  #snapshot(): void {
    const { key } = this.#encoder;
    if (key !== null) this.#relay.take(key, this.#run, null);
  }

  /** The data held by the link arrives one by one, as over a slow connection. */
  #thaw(): void {
    const held = ({ atMs }: { atMs: number }) => atMs === Number.POSITIVE_INFINITY;
    for (const [n, one] of (this.#connection?.down.filter(held) ?? []).entries())
      one.atMs = this.nowMs + LINK_MS + n * STEP_MS;
    for (const one of this.#connection?.up.filter(held) ?? []) one.atMs = this.nowMs + LINK_MS;
  }

  #cut(): void {
    if (this.#connection === null) return;
    this.#connection = null;
    this.#do(this.#session.closed(this.nowMs, 1006, 'cut'));
  }

  /** Where the robot is: the time, or the time at which it stopped. */
  #poseMs(): number {
    const stand = this.#stands.at(-1);
    return this.#is('robot stands') && stand !== undefined ? stand.fromMs : this.nowMs;
  }

  #robot(): void {
    if (this.nowMs < this.#sampleMs) return;
    this.#sampleMs = this.nowMs + SAMPLE_MS;
    if (this.#is('source silent') || this.#is('edge restarted')) return;
    const code = Math.floor((this.#poseMs() - EPOCH_MS) / POSE_STEP_MS);
    if (code === this.#sentCode && this.nowMs - this.#encodedMs < CONFIRM_MS) return;
    if (code !== this.#sentCode) this.#outdoneMs.set(this.#sentCode, this.nowMs);
    this.#sentCode = code;
    this.#encodedMs = this.nowMs;
    const codes = codesWith({ 'pos.RKN': code });
    const frame = this.#encoder.encode(codes, this.#seq++, this.nowMs / 1000, this.nowMs / 1000);
    if (!this.#is('uplink cut') && !this.#is('relay restarted')) {
      const before = this.#relay.newest;
      this.#relay.take(frame, this.#run, this.nowMs);
      if (this.#relay.newest === before) this.#snapshot(); // its base was lost: request it
    }
  }

  #serve(): void {
    const { nowMs } = this;
    const link = this.#connection;
    if (link === null) return;
    if (!link.open) {
      if (this.#is('link cut') || this.#is('relay restarted')) this.#cut();
      else if (nowMs >= link.openAtMs && this.#frozenMs === null) {
        link.open = true;
        const limits = { type: 'hello', wire: 1, server_time: 0, robot: 'demo', view: 'public', limits: {} };
        this.#write(link, { text: JSON.stringify({ ...limits, hz: link.hz, model: null }) });
        this.#write(link, { text: this.#relay.status(nowMs) });
        this.#write(link, { text: SCHEMA_TEXT });
        link.statusMs = nowMs;
        this.#hand(link);
      }
      return;
    }
    for (const { text } of link.up.splice(0, link.up.filter(({ atMs }) => atMs <= nowMs).length)) {
      const said = JSON.parse(text) as { type: string; t: number; hz: number };
      if (said.type === 'ping')
        this.#write(link, { text: JSON.stringify({ type: 'pong', t: said.t, clock_ms: clockMs(nowMs) }) });
      if (said.type === 'rate') link.hz = said.hz;
    }
    if (this.#frozenMs !== null && nowMs - this.#frozenMs > BACKLOG_MS) return;
    if (nowMs - link.statusMs >= STATUS_MS) {
      link.statusMs = nowMs;
      this.#write(link, { text: this.#relay.status(nowMs) });
    }
    if (link.hz > 0 && nowMs - link.frameMs >= VIEWER_MS) this.#hand(link);
  }

  /** The frames that this viewer lacks, and the newest. */
  #hand(link: Connection): void {
    const { newest } = this.#relay;
    if (newest === null || link.given.newest === newest) return;
    link.frameMs = this.nowMs;
    // A frame that the edge has not just sent is sent with its age, so that it does not count as a sign of life.
    if (!this.#relay.isLive) this.#write(link, { text: this.#relay.status(this.nowMs) });
    if (newest.key !== null && link.given.key !== newest.key) this.#write(link, { frame: newest.key.bytes });
    this.#write(link, { frame: newest.bytes });
    link.given = { key: newest.key ?? newest, newest };
  }

  #write(link: Connection, wire: Wire): void {
    const lateMs = Math.min(LATE_MS, LATER * (this.nowMs - (this.#lateSinceMs ?? this.nowMs)));
    const soonMs = Math.max(this.nowMs + LINK_MS + lateMs, link.down.at(-1)?.atMs ?? 0); // after the data in transit
    const atMs = this.#frozenMs === null ? soonMs : Number.POSITIVE_INFINITY;
    link.down.push({ wire, atMs, writtenMs: this.nowMs });
  }

  /** The arrived data; after a stall, all that has piled up. */
  #deliver(): void {
    const link = this.#connection;
    if (link === null) return;
    const { nowMs } = this;
    for (const { askedMs } of link.asked.splice(0, link.asked.filter(({ atMs }) => atMs <= nowMs).length)) {
      const clock_ms = clockMs(askedMs + LINK_MS);
      this.#do(this.#session.clock(nowMs, askedMs, JSON.stringify({ type: 'pong', t: askedMs, clock_ms })));
    }
    const due = link.down.filter(({ atMs }) => atMs <= nowMs).length;
    if (due > 0) {
      if (nowMs - this.#heardMs > STALE_AFTER_MS) this.#silentUntilMs = nowMs;
      this.#heardMs = nowMs;
    }
    for (const { wire, writtenMs } of link.down.splice(0, due)) {
      if (!link.isOpened) {
        link.isOpened = true;
        this.#do(this.#session.opened(nowMs));
      }
      if (this.#connection !== link) return;
      if (link.on === 'events') {
        this.#do(this.#session.heard(nowMs));
        this.#session.stamped(nowMs, clockMs(writtenMs));
      }
      if ('text' in wire && wire.text.includes('"status"')) this.#statusLateMs = nowMs - writtenMs - LINK_MS;
      this.#do(
        'text' in wire ? this.#session.text(nowMs, wire.text) : this.#session.binary(nowMs, wire.frame),
      );
      if (this.#connection !== link) return;
    }
  }

  #do(actions: readonly Action[]): void {
    for (const action of actions) {
      if (action.do === 'connect') this.#connect(action.by === 'events' ? 'events' : 'websocket');
      else if (action.do === 'drop') this.#connection = null;
      else if (action.do === 'send') this.#send(action.text);
      else if (action.do === 'ask')
        this.#connection?.asked.push({ askedMs: this.nowMs, atMs: this.nowMs + 2 * LINK_MS });
      else if (action.do === 'post') this.#post(action.message);
    }
  }

  #connect(by: 'websocket' | 'events'): void {
    this.#connection = new Connection(by, this.nowMs + 2 * LINK_MS);
    if (by !== this.#carrier) this.#cut(); // no WebSocket gets through here
  }

  #send(text: string): void {
    const atMs = this.#frozenMs === null ? this.nowMs + LINK_MS : Number.POSITIVE_INFINITY;
    this.#connection?.up.push({ text, atMs });
  }

  #post(message: FromStream): void {
    const twin = this.#twin;
    if (message.kind === 'link') twin.acceptConnection(message.phase === 'open', this.nowMs);
    else if (message.kind === 'schema') twin.acceptSchema(SCHEMA);
    else if (message.kind === 'status') twin.acceptStatus(message.status);
    else if (message.kind === 'state') {
      twin.acceptState(message.state);
      const sampledMs = message.state.tS * 1000;
      const isSeen = this.#carrier === 'events' || this.#silentUntilMs >= sampledMs;
      this.#unseenMs = isSeen ? 0 : Math.max(0, this.nowMs - sampledMs - this.#statusLateMs);
    }
  }

  #look(): void {
    const { word } = judge(this.#twin.evidence, this.nowMs);
    const claims = isClaim(word);
    if (!claims && word !== null && isClaim(this.#word)) {
      this.#otherwiseMs = this.nowMs;
      this.#twin.evidence.otherwiseMs = this.nowMs; // as the page's watch does
      this.#do(this.#session.doubt(this.nowMs, this.nowMs));
    }
    if (word !== this.#word || this.words.length === 0) this.words.push(word);
    this.#word = word;
    if (!claims || this.#is('page hidden')) return;
    const lie = this.#lie(word);
    if (lie !== null) this.lies.push(`${((this.nowMs - EPOCH_MS) / 1000).toFixed(2)} s: ${lie}`);
  }

  #lie(word: Word): string | null {
    const code = this.#twin.value('pos', 'RKN');
    if (code == null) return `${word} without a pose`;
    const poseMs = EPOCH_MS + Math.round(code * 1000) * POSE_STEP_MS;
    const stand = this.#stands.find(({ fromMs }) => Math.abs(fromMs - poseMs) < 2 * POSE_STEP_MS);
    const trueUntilMs = stand?.toMs ?? poseMs;
    const oldMs = this.nowMs - trueUntilMs;
    if (oldMs > STALE_AFTER_MS + Math.max(this.#onItsWayMs, this.#unseenMs))
      return `${word} with a pose of ${oldMs} ms ago`;
    // What the robot has reported since may still be in transit.
    const outdoneMs = this.#outdoneMs.get(Math.round(code * 1000)) ?? this.nowMs;
    const isOutdone = this.nowMs - outdoneMs > this.#onItsWayMs;
    if (isOutdone && trueUntilMs < this.#otherwiseMs - this.#onItsWayMs)
      return `${word} again with a pose of before (${oldMs} ms)`;
    const stoodMs = stand === undefined ? 0 : this.nowMs - stand.fromMs;
    if (word === 'HOLDING' && stoodMs < HOLDING_AFTER_MS) return 'HOLDING while the robot moved';
    return null;
  }
}
