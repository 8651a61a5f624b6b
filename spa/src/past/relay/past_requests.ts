import type { Schema } from '@posecast/wire';
import { answerBytes } from '../answer_bytes.ts';
import { PastError } from '../past_source.ts';

interface Running {
  readonly answer: Promise<unknown>;
  readonly stop: AbortController;
  waiting: number;
}

/** Running requests. Callers that ask for the same thing share one answer; a request is cancelled when nobody waits for it any
 *  more. */
export class SharedRequests {
  readonly #running = new Map<string, Running>();

  /** The answer of `request`, or of a running request with the same key. Rejects as that does, or with the reason of `signal`. */
  async ask<T>(key: string, request: (signal: AbortSignal) => Promise<T>, signal?: AbortSignal): Promise<T> {
    signal?.throwIfAborted();
    const running = this.#running.get(key) ?? this.#start(key, request);
    running.waiting += 1;
    let leave = () => {};
    const left = new Promise<never>((_, reject) => {
      leave = () => reject(signal?.reason);
      signal?.addEventListener('abort', leave);
    });
    try {
      return (await Promise.race([running.answer, left])) as T;
    } finally {
      signal?.removeEventListener('abort', leave);
      running.waiting -= 1;
      if (running.waiting === 0) this.#end(key, running);
    }
  }

  has(key: string): boolean {
    return this.#running.has(key);
  }

  /** Cancels all of them: they reject. */
  close(): void {
    for (const [key, running] of this.#running) this.#end(key, running);
  }

  #start(key: string, request: (signal: AbortSignal) => Promise<unknown>): Running {
    const stop = new AbortController();
    const stopped = new Promise<never>((_, reject) => {
      stop.signal.addEventListener('abort', () => reject(stop.signal.reason));
    });
    const running: Running = { answer: Promise.race([request(stop.signal), stopped]), stop, waiting: 0 };
    running.answer.catch(() => {}); // the callers handle the rejection; there may be none left
    this.#running.set(key, running);
    return running;
  }

  #end(key: string, running: Running): void {
    if (this.#running.get(key) === running) this.#running.delete(key);
    running.stop.abort(new PastError('away', 'nobody waits for it any more'));
  }
}

const RETRY_MS = 500;
const LATE_MS = 20_000;
/** The longest answer is a segment: 1 MiB each of header and records, plus some overhead. */
const BYTES_MAX = 3_000_000;

/** What the page provides for the past of a relay. */
export interface RelayPorts {
  readonly fetch: (url: string, init: RequestInit) => Promise<Response>;
  /** The token for a URL, if there is one. */
  readonly tokenFor: (url: string) => string | undefined;
  /** A monotonic clock, ms. */
  readonly nowMs: () => number;
  /** Calls `run` after `ms`. Returns a function that cancels it. */
  readonly later: (ms: number, run: () => void) => () => void;
  /** Whether unprompted requests are paused: nobody sees the page, or the relay does not know the robot. */
  readonly isIdle: () => boolean;
  /** The live schema; null if there is none yet. The past almost always has the same one. */
  readonly liveSchema: () => Schema | null;
}

/** A complete answer. */
export interface Answer {
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly isJson: boolean;
}

/** Fetches what lies below an address. Rejects with a `PastError`, or with the reason of the signal. */
export class PastRequests {
  readonly #baseUrl: string;
  readonly #ports: Pick<RelayPorts, 'fetch' | 'tokenFor' | 'later'>;

  constructor(baseUrl: string, ports: Pick<RelayPorts, 'fetch' | 'tokenFor' | 'later'>) {
    this.#baseUrl = baseUrl;
    this.#ports = ports;
  }

  /** `path`: '', or with a leading slash. Tries twice if there is no answer. */
  async get(path: string, signal: AbortSignal): Promise<Answer> {
    const first = await this.#try(path, signal);
    if (first !== null) return first;
    await new Promise<void>((resolve) => this.#ports.later(RETRY_MS, resolve));
    signal.throwIfAborted();
    const second = await this.#try(path, signal);
    if (second === null) throw new PastError('away', `past${path}: no answer`);
    return second;
  }

  async getJson(
    path: string,
    signal: AbortSignal,
  ): Promise<{ readonly json: unknown; readonly size: number }> {
    const { bytes } = await this.get(path, signal);
    try {
      return { json: JSON.parse(new TextDecoder().decode(bytes)), size: bytes.length };
    } catch {
      throw new PastError('damaged', `past${path}: no JSON`);
    }
  }

  /** The answer; null if there was none. */
  async #try(path: string, signal: AbortSignal): Promise<Answer | null> {
    const url = this.#baseUrl + path;
    const late = new AbortController();
    const inTime = this.#ports.later(LATE_MS, () => late.abort());
    try {
      const token = this.#ports.tokenFor(url);
      const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
      const response = await this.#ports.fetch(url, {
        signal: AbortSignal.any([signal, late.signal]),
        headers,
      });
      const { status } = response;
      if (status === 200) {
        const isJson = response.headers.get('content-type')?.startsWith('application/json') ?? false;
        return { bytes: await answerBytes(response, `past${path}`, BYTES_MAX), isJson };
      }
      await response.body?.cancel();
      if (status >= 400 && status !== 429 && (status < 500 || status === 501))
        throw new PastError('gone', `past${path}: answered ${status}`);
      return null;
    } catch (error) {
      signal.throwIfAborted();
      if (error instanceof PastError) throw error;
      return null;
    } finally {
      inTime();
    }
  }
}
