/** Maximum length of an event, in characters. The schema of a robot with a thousand joints takes a tenth of it. */
const LONGEST = 4_000_000;

/** One server-sent event. */
export interface StreamEvent {
  readonly name: string;
  readonly data: string;
  /** The newest `id` of the stream: the relay's clock, ms. NaN before the first. */
  readonly writtenMs: number;
}

/** Incremental parser of `text/event-stream` (WHATWG HTML §9.2.6), for the part of the format that a relay uses. */
export class SseParser {
  /** Pieces of a line whose end has not arrived. */
  #pieces: string[] = [];
  #length = 0;
  #name = '';
  #data: string[] = [];
  #kept = 0;
  #writtenMs = Number.NaN;
  readonly #utf8 = new TextDecoder();

  /** Takes the next bytes and returns the events that they complete. Throws RangeError if one grows too long. */
  read(bytes: Uint8Array): StreamEvent[] {
    const found: StreamEvent[] = [];
    const [first = '', ...lines] = this.#utf8.decode(bytes, { stream: true }).split('\n');
    this.#keep(first);
    for (const begun of lines) {
      const line = this.#pieces.join('');
      this.#line(line.endsWith('\r') ? line.slice(0, -1) : line, found);
      this.#pieces = [];
      this.#length = 0;
      this.#keep(begun);
    }
    if (this.#length + this.#kept > LONGEST) throw new RangeError('an event without end');
    return found;
  }

  #keep(piece: string): void {
    if (piece === '') return;
    this.#pieces.push(piece);
    this.#length += piece.length;
  }

  #line(line: string, found: StreamEvent[]): void {
    if (line === '') {
      if (this.#data.length > 0) {
        found.push({
          name: this.#name || 'message',
          data: this.#data.join('\n'),
          writtenMs: this.#writtenMs,
        });
      }
      this.#name = '';
      this.#data = [];
      this.#kept = 0;
      return;
    }
    const colon = line.indexOf(':');
    const field = colon < 0 ? line : line.slice(0, colon);
    const value = colon < 0 ? '' : line.slice(line[colon + 1] === ' ' ? colon + 2 : colon + 1);
    if (field === 'data') {
      this.#data.push(value);
      this.#kept += value.length;
    } else if (field === 'event') this.#name = value;
    else if (field === 'id') this.#writtenMs = value === '' ? Number.NaN : Number(value);
  }
}

/** Decodes a frame from base64; null if the text is not base64. */
export function frameBytes(base64: string): Uint8Array | null {
  try {
    return Uint8Array.from(atob(base64), (char) => char.charCodeAt(0));
  } catch {
    return null;
  }
}

/** Receives the events of a stream. */
export interface EventTaker<T> {
  stamped(nowMs: number, writtenMs: number): void;
  text(nowMs: number, text: string): T;
  binary(nowMs: number, frame: Uint8Array): T;
}

/** Delivers an event that has just arrived. */
export function deliver<T>({ name, data, writtenMs }: StreamEvent, nowMs: number, to: EventTaker<T>): T {
  if (Number.isFinite(writtenMs)) to.stamped(nowMs, writtenMs);
  const frame = name === 'frame' ? frameBytes(data) : null;
  return frame === null ? to.text(nowMs, data) : to.binary(nowMs, frame);
}

/** Callbacks and settings for `openEventStream`. */
export interface EventsHandlers {
  /** Passed in, not imported, because WebKit runs the worker's script a second time for a chunk that imports from it. */
  nowMs(): number;
  readonly wireVersion: number;
  /** The relay has started to answer. */
  opened(): void;
  /** Bytes arrived, even if no event is complete. */
  heard(): void;
  event(event: StreamEvent): void;
  /** The answer to a question for the relay's clock that was sent at `askedMs`. */
  clock(askedMs: number, text: string): void;
  /** The stream ended, or never began. The code is from the close table (wire/SPEC.md), or 1006. */
  closed(code: number, reason: string): void;
}

/** No answer to a question for the relay's clock is useful after this time. */
const ANSWER_LIMIT_MS = 10_000;

/** A stream of server-sent events. */
export interface EventStream {
  close(): void;
  /** Asks for the relay's clock at this address, beside the stream. */
  ask(url: string): void;
}

/** Opens a stream of server-sent events with `fetch`. `EventSource` can't send headers, hides the HTTP status and
 *  reconnects by its own rules. */
export function openEventStream(
  url: string,
  token: string | undefined,
  handlers: EventsHandlers,
): EventStream {
  const leave = new AbortController();
  const ask = async (address: string) => {
    const askedMs = handlers.nowMs();
    const answer = await fetch(`${address}?t=${askedMs}`, {
      signal: AbortSignal.any([leave.signal, AbortSignal.timeout(ANSWER_LIMIT_MS)]),
      cache: 'no-store',
    });
    handlers.clock(askedMs, await answer.text());
  };
  const run = async () => {
    const answer = await fetch(url, {
      signal: leave.signal,
      cache: 'no-store',
      headers: {
        accept: 'text/event-stream',
        ...(token === undefined ? {} : { authorization: `Bearer ${token}` }),
      },
    });
    const { status, body } = answer;
    const type = answer.headers.get('content-type') ?? '';
    if (status !== 200 || body === null || !type.startsWith('text/event-stream')) {
      leave.abort();
      // a relay refuses with JSON; any other host, or a proxy that people sign in to, answers with a page
      const isRefusal = type.startsWith('application/json') && [401, 403, 404].includes(status);
      return isRefusal ? 4000 + status : 1006;
    }
    handlers.opened();
    const reader = new SseParser();
    const chunks = body.getReader();
    for (;;) {
      const { done, value } = await chunks.read();
      if (leave.signal.aborted) return null;
      if (done) return 1006;
      handlers.heard();
      for (const event of reader.read(value)) {
        handlers.event(event);
        if (leave.signal.aborted) return null;
      }
    }
  };
  run().then(
    (code) => code !== null && handlers.closed(code, 'the answer ended'),
    (error: unknown) => {
      if (leave.signal.aborted) return;
      leave.abort();
      handlers.closed(1006, error instanceof Error ? error.message : String(error));
    },
  );
  return {
    close: () => leave.abort(),
    ask: (address) => void ask(address).catch(() => undefined), // without an answer, nothing is known
  };
}
