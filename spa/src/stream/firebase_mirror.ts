import {
  deliver,
  type EventsHandlers,
  frameBytes,
  openEventStream as openStream,
  type StreamEvent,
} from './sse.ts';

export { deliver };

/** How often a relay writes to its mirror. */
const MIRROR_HZ = 2;
const TICK_MS = 250;
/** A relay writes at least once a second. If it has not, the data in the mirror may be of any age. */
const UNWRITTEN_MS = 1400;
/** The first write gets more time: it may need the relay's own round trip to the database. */
const FIRST_MS = 2500;
const SAY_EVERY_MS = 1000;
/** If writes stop for this long, the connection itself may be dead: a new one is opened to find out. */
const DOUBT_MS = 8000;
/** Silence after which the connection is dead: the database sends `keep-alive` every 30 s. */
const DEAD_MS = 45_000;

/** The relay's `status` in the mirror, about itself and its robot. */
interface Written {
  readonly robot: string;
  readonly age_ms: number | null;
  readonly seq: number | null;
  readonly model: string | null;
  /** The relay's clock at the write, ms. */
  readonly at: number;
}

/**
 * Translates a robot's node in a Firebase Realtime Database, as it is streamed, into the messages of a relay. Pure: events and
 * the clock are passed in. A node outlives its relay, so only a change of the node, not its content, is a sign of life.
 */
export class MirrorReader {
  readonly #wireVersion: number;
  #node: unknown = null;
  #told: Record<string, unknown> = {};
  /** The newest status written while we were listening. */
  #written: Written | null = null;
  #writtenMs = 0;
  #begunMs: number | null = null;
  #saidMs = 0;
  /** Added to the relay's timestamps, so that they keep increasing when the relay's clock is set back. */
  #shiftMs = 0;

  constructor(wireVersion: number) {
    this.#wireVersion = wireVersion;
  }

  /** The messages that a relay would have sent for this event, or the close code (a number) if the stream is over. */
  read(nowMs: number, { name, data }: Pick<StreamEvent, 'name' | 'data'>): StreamEvent[] | number {
    if (name === 'cancel' || name === 'auth_revoked') return 4403;
    if (name !== 'put' && name !== 'patch') return [];
    const said: unknown = parse(data);
    if (!isRecord(said) || typeof said.path !== 'string') return [];
    const own = new Set<unknown>();
    if (name === 'put') this.#put(said.path, said.data, own);
    else
      for (const [below, value] of Object.entries(said.data ?? {}))
        this.#put(`${said.path}/${below}`, value, own);
    const first = this.#begunMs === null;
    this.#begunMs ??= nowMs;
    return this.#news(nowMs, first);
  }

  /** Status messages that are due although the database sent nothing. */
  tick(nowMs: number): StreamEvent[] {
    if (this.#begunMs === null || nowMs - this.#saidMs < SAY_EVERY_MS) return [];
    if (this.#node === null) return [this.#status(nowMs, 'offline', null, false)];
    const waited =
      this.#written === null ? nowMs - this.#begunMs > FIRST_MS : this.#unwrittenMs(nowMs) > UNWRITTEN_MS;
    if (!waited) return [];
    const { robot = 'offline', age_ms = null } = this.#written ?? {};
    return [this.#status(nowMs, robot, age_ms === null ? null : age_ms + this.#unwrittenMs(nowMs), true)];
  }

  /** Whether writes have stopped for so long that this connection may be dead and a new one should be tried. */
  doubtful(nowMs: number): boolean {
    return this.#written !== null && this.#node !== null && this.#unwrittenMs(nowMs) > DOUBT_MS;
  }

  #unwrittenMs(nowMs: number): number {
    return nowMs - this.#writtenMs;
  }

  /** Sets the value at `path` in a copy of the node. `own`: objects that this event has already copied. */
  #put(path: string, value: unknown, own: Set<unknown>): void {
    const [child, ...deeper] = path.split('/').filter((part) => part !== '');
    if (child === undefined) {
      this.#node = isRecord(value) ? value : null;
      return;
    }
    const node = ownOf(this.#node, own);
    this.#node = node;
    const at = deeper.join('/');
    if (at === '') define(node, child, value);
    else {
      const inside = ownOf(node[child], own);
      define(inside, at, value);
      define(node, child, inside);
    }
  }

  #news(nowMs: number, first: boolean): StreamEvent[] {
    const node = isRecord(this.#node) ? this.#node : {};
    const out: StreamEvent[] = [];
    const { status } = node;
    const written = isWritten(status) ? status : null;
    const alive = !first && written !== null && written.at !== this.#told.at;
    if (alive) this.#wrote(nowMs, written);
    const writtenMs = alive ? written.at + this.#shiftMs : Number.NaN;
    const say = (doc: object) => out.push({ name: 'message', data: JSON.stringify(doc), writtenMs });
    if (first) {
      const of = { robot: '', view: '', limits: {}, model: written?.model ?? null };
      say({ type: 'hello', wire: this.#wireVersion, server_time: 0, hz: MIRROR_HZ, ...of });
    } else if (written?.model && written.model !== this.#told.model) {
      say({ type: 'model', hash: written.model });
    }
    const changed = (child: string) => node[child] !== this.#told[child];
    const schema = changed('schema') ? decoded(node.schema) : null;
    if (schema !== null) out.push({ name: 'message', data: schema, writtenMs });
    // Before the frames, because it alone determines their age.
    if (alive) {
      out.push(this.#status(nowMs, written.robot, written.age_ms, false, writtenMs));
    } else if (this.#node === null) {
      this.#written = null;
      out.push(this.#status(nowMs, 'offline', null, false));
    }
    // A KEY that is also the newest frame is in the node twice.
    for (const frame of new Set(['key', 'frame'].filter(changed).map((child) => node[child]))) {
      if (typeof frame === 'string') out.push({ name: 'frame', data: frame, writtenMs });
    }
    this.#told = { ...node, at: written?.at, model: written?.model };
    return out;
  }

  #wrote(nowMs: number, written: Written): void {
    const last = this.#told.at;
    if (typeof last === 'number' && written.at < last && this.#written !== null) {
      this.#shiftMs += last - written.at + this.#unwrittenMs(nowMs);
    }
    this.#written = written;
    this.#writtenMs = nowMs;
  }

  #status(
    nowMs: number,
    robot: string,
    ageMs: number | null,
    degraded: boolean,
    writtenMs = Number.NaN,
  ): StreamEvent {
    this.#saidMs = nowMs;
    const seq = this.#written?.seq ?? null;
    const doc = { type: 'status', robot, age_ms: ageMs, seq, degraded };
    return { name: 'message', data: JSON.stringify(doc), writtenMs };
  }
}

/** Like `openEventStream` of `sse.ts`, but reads a robot's node in a Firebase database; `_token` is not used. */
export function openEventStream(
  url: string,
  _token: string | undefined,
  handlers: EventsHandlers,
): { close(): void } {
  const { nowMs, wireVersion } = handlers;
  const reader = new MirrorReader(wireVersion);
  let heardMs = nowMs();
  const leave = () => {
    clearInterval(timer);
    stream.close();
  };
  const end = (code: number, reason: string) => {
    leave();
    handlers.closed(code, reason);
  };
  const timer = setInterval(() => {
    const now = nowMs();
    if (now - heardMs > DEAD_MS || reader.doubtful(now)) end(1006, 'silent');
    else for (const event of reader.tick(now)) handlers.event(event);
  }, TICK_MS);
  const stream = openStream(url, undefined, {
    nowMs,
    wireVersion,
    opened: () => handlers.opened(),
    heard: () => {
      heardMs = nowMs();
      handlers.heard();
    },
    event: (event) => {
      const news = reader.read(nowMs(), event);
      if (typeof news === 'number') end(news, 'the rules of the database have changed');
      else for (const one of news) handlers.event(one);
    },
    clock: () => {}, // it is not asked
    // Signing in does not help either if the mirror is not readable.
    closed: (code, reason) => end(code === 4401 ? 4403 : code, reason),
  });
  return { close: leave };
}

/** The object itself if this event has already copied it, else a new copy, which is added to `own`. */
function ownOf(value: unknown, own: Set<unknown>): Record<string, unknown> {
  if (own.has(value)) return value as Record<string, unknown>;
  const copy = isRecord(value) ? { ...value } : {};
  own.add(copy);
  return copy;
}

/** Sets an own property. Unlike an assignment, this is safe for a name like `__proto__`. */
function define(object: object, name: string, value: unknown): void {
  Object.defineProperty(object, name, { value, writable: true, enumerable: true, configurable: true });
}

function parse(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    return null;
  }
}

function isRecord(value: unknown): value is Record<string, unknown> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

function isWritten(value: unknown): value is Written {
  return isRecord(value) && typeof value.at === 'number' && typeof value.robot === 'string';
}

/** Base64 decoded to UTF-8 text; null if the value is not base64. */
function decoded(base64: unknown): string | null {
  const bytes = typeof base64 === 'string' ? frameBytes(base64) : null;
  return bytes && new TextDecoder().decode(bytes);
}
