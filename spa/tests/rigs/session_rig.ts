import type { Action, FromStream } from '../../src/stream/messages.ts';
import { Session } from '../../src/stream/session.ts';
import { Frames, SCHEMA_TEXT } from './schema.ts';

type Kind = FromStream['kind'];

/** What the relay's clock reads when the session's reads 0, ms. */
export const RELAY_MS = 7e11;

/** From the request for events to their opening, in `fallBack`. */
export const OPENING_MS = 500;

/** A session with a manual clock and a record of its actions. The relay's messages take no time. */
export class Rig {
  now = 1_000_000;
  #onEvents = false;
  /** How long ago the relay wrote what arrives on events. */
  #lateMs = 0;
  readonly session: Session;
  /** What the robot sends. */
  readonly frames = new Frames();
  readonly done: Action[] = [];

  constructor(random = 0.5, visible = true, url = 'ws://relay/live') {
    this.session = new Session(url, 30, visible, () => random);
  }

  do(actions: readonly Action[]): void {
    this.done.push(...actions);
  }

  /** Its actions since the last check. */
  take(): Action[] {
    return this.done.splice(0);
  }

  posts<K extends Kind>(kind: K): Extract<FromStream, { kind: K }>[] {
    return this.take().flatMap((action) =>
      action.do === 'post' && action.message.kind === kind
        ? [action.message as Extract<FromStream, { kind: K }>]
        : [],
    );
  }

  sent(): unknown[] {
    return this.take().flatMap((action) =>
      action.do === 'send' ? [JSON.parse(action.text) as unknown] : [],
    );
  }

  /** The addresses that it requested since the last check. */
  asked(): string[] {
    return this.take().flatMap((action) => (action.do === 'connect' ? [action.url] : []));
  }

  /** Two attempts fail: it now uses events. */
  fallBack(): void {
    this.do(this.session.start(this.now));
    for (let failure = 0; failure < 2; failure++) {
      this.do(this.session.closed(this.now, 1006, ''));
      this.pass(1000);
    }
    this.#onEvents = true;
    this.do(this.session.opened(this.now));
    this.hello();
  }

  hello(more: object = {}): void {
    const hello = { type: 'hello', wire: 1, server_time: 0, robot: 'r', view: 'public', hz: 30, model: null };
    this.say({ ...hello, ...more });
  }

  /** The next frame, which the relay wrote this long ago, as what follows. */
  lateNext(lateMs: number): void {
    this.#lateMs = lateMs;
    this.next();
  }

  open(): void {
    this.do(this.session.start(this.now));
    this.do(this.session.opened(this.now));
  }

  say(message: object): void {
    this.#stamp();
    this.do(this.session.text(this.now, JSON.stringify(message)));
  }

  status(changed: object = {}): void {
    const clock_ms = RELAY_MS + this.now;
    this.say({ type: 'status', robot: 'online', age_ms: 20, seq: 0, clock_ms, ...changed });
  }

  /** The answer to the ping of `t`. */
  pong(t: unknown): void {
    this.say({ type: 'pong', t, clock_ms: RELAY_MS + this.now });
  }

  schema(): void {
    this.do(this.session.text(this.now, SCHEMA_TEXT));
  }

  #stamp(): void {
    if (this.#onEvents) this.session.stamped(this.now, RELAY_MS + this.now - this.#lateMs);
  }

  frame(bytes: Uint8Array): void {
    this.#stamp();
    this.do(this.session.binary(this.now, bytes));
  }

  next(...args: Parameters<Frames['next']>): void {
    this.frame(this.frames.next(...args));
  }

  /** Advances the time, ticking like the worker. */
  pass(ms: number): void {
    const until = this.now + ms;
    while (this.now < until) {
      this.now = Math.min(until, this.now + 250);
      this.do(this.session.tick(this.now));
    }
  }

  /** Time passes while the relay sends what it must: a status a second. */
  passWithStatus(ms: number): void {
    const until = this.now + ms;
    while (this.now < until) {
      this.pass(Math.min(1000, until - this.now));
      if (this.session.phase === 'open') this.status();
    }
  }
}

/** It is connected, to a robot without a frame so far. */
export function opened(): Rig {
  const rig = new Rig();
  rig.open();
  rig.status();
  rig.schema();
  rig.take();
  return rig;
}
