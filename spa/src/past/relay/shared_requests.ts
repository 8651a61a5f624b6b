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
