import { readAtMost } from '../kit.ts';
import { PastError } from './past_source.ts';

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

/** Delay before the second try after a failure, ms. Whoever needs the answer asks again later. */
const RETRY_MS = 500;
/** A host that is silent for this long counts as unreachable, ms. */
const SILENT_MS = 20_000;

export interface FetchPorts {
  readonly fetch: (url: string, init: RequestInit) => Promise<Response>;
  /** Calls `run` after `ms`. Returns a function that cancels it. */
  readonly later: (ms: number, run: () => void) => () => void;
}

interface Wanted {
  readonly url: string;
  /** For messages. */
  readonly name: string;
  /** The most bytes that it may have. */
  readonly most: number;
  readonly headers?: HeadersInit;
  readonly signal?: AbortSignal | undefined;
  /** What it means if both answers break off: a static host keeps failing, a relay may do better later. */
  readonly cutTwice: 'damaged' | 'away';
}

/** A complete answer. */
export interface Answer {
  readonly bytes: Uint8Array<ArrayBuffer>;
  readonly isJson: boolean;
}

/** Fetches something, in two tries if there is no answer. Rejects with a `PastError`, or with the reason of the signal. */
export async function fetchTwice(wanted: Wanted, ports: FetchPorts): Promise<Answer> {
  const { name, signal, cutTwice } = wanted;
  const first = await fetchOnce(wanted, ports);
  if (typeof first !== 'string') return first;
  await new Promise<void>((resolve) => ports.later(RETRY_MS, resolve));
  signal?.throwIfAborted();
  const second = await fetchOnce(wanted, ports);
  if (typeof second !== 'string') return second;
  // if the network is down, the second try gets no answer at all
  const isCut = first === 'cut' && second === 'cut';
  throw isCut
    ? new PastError(cutTwice, `${name}: the answer broke off`)
    : new PastError('away', `${name}: no answer`);
}

async function fetchOnce(
  { url, name, most, headers, signal }: Wanted,
  ports: FetchPorts,
): Promise<Answer | 'cut' | 'no answer'> {
  const silent = new AbortController();
  let callOff = () => {};
  const heard = () => {
    callOff();
    callOff = ports.later(SILENT_MS, () => silent.abort());
  };
  heard();
  let tried: 'cut' | 'no answer' = 'no answer';
  try {
    const either = signal === undefined ? silent.signal : AbortSignal.any([signal, silent.signal]);
    const response = await ports.fetch(url, { signal: either, ...(headers && { headers }) });
    const { status, body } = response;
    if (status === 200) {
      tried = 'cut';
      const bytes = await readAtMost(body, most, heard);
      if (bytes === null) throw new PastError('damaged', `${name}: more than ${most} bytes`);
      const isJson = response.headers.get('content-type')?.startsWith('application/json') ?? false;
      return { bytes, isJson };
    }
    await body?.cancel();
    if (status >= 400 && status !== 429 && (status < 500 || status === 501))
      throw new PastError('gone', `${name}: answered ${status}`);
    return tried;
  } catch (error) {
    signal?.throwIfAborted();
    if (error instanceof PastError) throw error;
    return silent.signal.aborted ? 'no answer' : tried;
  } finally {
    callOff();
  }
}
