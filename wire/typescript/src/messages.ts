/** The JSON messages of the stream (SPEC "Messages"). */

import { isObject, parseJson } from './checked.ts';

/** Bound for times of any clock, positive and negative: 31,700 years, so that milliseconds still fit a double. */
const TIME_MAX_S = 1e12;
/** Characters of the address of a lane. */
const LANE_MAX = 300;

export type RobotStatus = 'online' | 'silent' | 'offline';
export type EventLevel = 'fault' | 'caution' | 'info';

/** First message of every connection. `server_time`: unix, s; `hz`: the rate granted. */
export interface Hello {
  readonly type: 'hello';
  readonly wire: number;
  readonly server_time: number;
  readonly robot: string;
  readonly view: string;
  readonly hz: number;
  /** What this viewer may do, as far as the relay limits it. */
  readonly limits: ReadonlyMap<string, number>;
  /** SHA-256 of the model's manifest, hexadecimal. */
  readonly model: string | null;
}

/**
 * After hello, then at least once a second. `age_ms`, `seq`: of the newest frame; null before any. `degraded`: the
 * relay does not hear of robots just now, for a reason of its own (a gateway without Redis). `over_share`: the robot
 * sends more than its share of the relay, so some of its frames are dropped. `clock_ms`: the relay's clock at that
 * moment, which never steps; only differences are meaningful. Null from a relay that does not send it.
 */
export interface Status {
  readonly type: 'status';
  readonly robot: RobotStatus;
  readonly age_ms: number | null;
  readonly seq: number | null;
  readonly degraded: boolean;
  readonly over_share: boolean;
  readonly clock_ms: number | null;
}

/** `text` is what arrived, to the byte: its hash is the schema's id. */
export interface SchemaMessage {
  readonly type: 'schema';
  readonly text: string;
}

/** Texts about the robot that change seldom; each message has all of them. */
export interface Info {
  readonly type: 'info';
  readonly kv: ReadonlyMap<string, string>;
}

/** Something that began or ended. `n`: the relay's number; `t`: robot clock, s; `at`: unix, s. */
export interface EventMessage {
  readonly type: 'event';
  readonly n: number;
  readonly t: number;
  readonly at: number | null;
  readonly level: EventLevel;
  readonly source: string;
  readonly text: string;
  readonly state: 'on' | 'off';
}

export interface RateGranted {
  readonly type: 'rate';
  readonly hz: number;
  readonly reason: string;
}

export interface ModelMessage {
  readonly type: 'model';
  readonly hash: string;
}

/** `t`: as sent. `clock_ms`: the relay's clock, as in `Status`. */
export interface Pong {
  readonly type: 'pong';
  readonly t: number;
  readonly clock_ms: number | null;
}

/**
 * Why the relay closes now. `retry_s`: see the retry rule of `code`. `lane`: where to read on meanwhile, as
 * segments by HTTP; to be resolved against the stream's address, and taken only on its origin, below its robot.
 */
export interface Bye {
  readonly type: 'bye';
  readonly code: number;
  readonly reason: string;
  readonly retry_s: number | null;
  readonly lane?: string;
}

export type RelayMessage =
  | Hello
  | Status
  | SchemaMessage
  | Info
  | EventMessage
  | RateGranted
  | ModelMessage
  | Pong
  | Bye;

/** `rate.hz` 0 = status and events only; `ack.n`: binary messages received on this connection. */
export type ViewerMessage =
  | { readonly type: 'rate'; readonly hz: number }
  | { readonly type: 'ack'; readonly n: number }
  | { readonly type: 'auth'; readonly token: string }
  | { readonly type: 'ping'; readonly t: number };

/**
 * One text message of the relay. Null when this viewer does not know it or it is not well formed: skip it,
 * a newer relay may say more. A schema is passed on as text for `parseSchema`.
 */
export function parseRelayMessage(text: string): RelayMessage | null {
  let value: unknown;
  try {
    value = parseJson(text);
  } catch {
    return null;
  }
  if (!isObject(value)) return null;
  const doc = new Map(Object.entries(value));
  const type = doc.get('type');
  if (type === 'schema') return { type, text };
  const read = typeof type === 'string' ? READERS.get(type) : undefined;
  return read?.(new Reader(doc)) ?? null;
}

const READERS = new Map<string, (r: Reader) => RelayMessage | null>([
  ['hello', hello],
  ['status', status],
  ['info', info],
  ['event', event],
  ['rate', rate],
  ['model', model],
  ['pong', pong],
  ['bye', bye],
]);

/** Takes typed values out of a message; undefined where one is not what it should be. */
class Reader {
  constructor(private readonly doc: ReadonlyMap<string, unknown>) {}

  number(name: string, most = Number.MAX_SAFE_INTEGER): number | undefined {
    const v = this.doc.get(name);
    return typeof v === 'number' && Math.abs(v) <= most ? v : undefined;
  }

  numberOrNull(name: string): number | null | undefined {
    return this.isNull(name) ? null : this.number(name);
  }

  /** Seconds of some clock. */
  time(name: string): number | undefined {
    return this.number(name, TIME_MAX_S);
  }

  text(name: string): string | undefined {
    const v = this.doc.get(name);
    return typeof v === 'string' ? v : undefined;
  }

  word<T extends string>(name: string, words: readonly T[]): T | undefined {
    return words.find((w) => w === this.doc.get(name));
  }

  hashOrNull(name: string): string | null | undefined {
    return this.isNull(name) ? null : this.hash(name);
  }

  hash(name: string): string | undefined {
    const v = this.text(name);
    return v !== undefined && /^[0-9a-f]{64}$/.test(v) ? v : undefined;
  }

  /** Entries of one kind; others are left out. */
  entries<T>(name: string, is: (v: unknown) => v is T): ReadonlyMap<string, T> | undefined {
    const v = this.doc.get(name);
    if (!isObject(v)) return undefined;
    return new Map(Object.entries(v).filter((e): e is [string, T] => is(e[1])));
  }

  /** Present and true. */
  is(name: string): boolean {
    return this.doc.get(name) === true;
  }

  private isNull(name: string): boolean {
    return (this.doc.get(name) ?? null) === null;
  }
}

function hello(r: Reader): Hello | null {
  const [wire, server_time, hz] = [r.number('wire'), r.time('server_time'), r.number('hz')];
  const [robot, view, model] = [r.text('robot'), r.text('view'), r.hashOrNull('model')];
  const limits = r.entries('limits', (v): v is number => typeof v === 'number') ?? new Map<string, number>();
  if (wire === undefined || server_time === undefined || hz === undefined) return null;
  if (robot === undefined || view === undefined || model === undefined) return null;
  return { type: 'hello', wire, server_time, robot, view, hz, limits, model };
}

function status(r: Reader): Status | null {
  const robot = r.word('robot', ['online', 'silent', 'offline']);
  const [age_ms, seq] = [r.numberOrNull('age_ms'), r.numberOrNull('seq')];
  if (robot === undefined || age_ms === undefined || seq === undefined) return null;
  const [degraded, over_share] = [r.is('degraded'), r.is('over_share')];
  return { type: 'status', robot, age_ms, seq, degraded, over_share, clock_ms: r.number('clock_ms') ?? null };
}

function info(r: Reader): Info | null {
  const kv = r.entries('kv', (v): v is string => typeof v === 'string');
  return kv ? { type: 'info', kv } : null;
}

function event(r: Reader): EventMessage | null {
  const [n, t, at] = [r.number('n'), r.time('t'), r.time('at') ?? null];
  const level = r.word('level', ['fault', 'caution', 'info']);
  const [source, text, state] = [r.text('source'), r.text('text'), r.word('state', ['on', 'off'])];
  if (n === undefined || t === undefined || level === undefined) return null;
  if (source === undefined || text === undefined || state === undefined) return null;
  return { type: 'event', n, t, at, level, source, text, state };
}

function rate(r: Reader): RateGranted | null {
  const hz = r.number('hz');
  return hz === undefined ? null : { type: 'rate', hz, reason: r.text('reason') ?? '' };
}

function model(r: Reader): ModelMessage | null {
  const hash = r.hash('hash');
  return hash === undefined ? null : { type: 'model', hash };
}

function pong(r: Reader): Pong | null {
  const t = r.number('t');
  return t === undefined ? null : { type: 'pong', t, clock_ms: r.number('clock_ms') ?? null };
}

function bye(r: Reader): Bye | null {
  const code = r.number('code');
  const retry_s = r.number('retry_s') ?? null;
  const lane = r.text('lane');
  const ofLane = lane !== undefined && lane.length <= LANE_MAX ? { lane } : {};
  return code === undefined
    ? null
    : { type: 'bye', code, reason: r.text('reason') ?? '', retry_s, ...ofLane };
}
