import { PastError } from '../past_source.ts';

interface Running {
  readonly answer: Promise<unknown>;
  readonly stop: AbortController;
  waiting: number;
}

/** Requests that are on their way. Who asks for the same waits for the same answer; a request ends when nobody waits for it
 *  any more. */
export class SharedRequests {
  readonly #running = new Map<string, Running>();

  /** The answer of `request`, or of the one with this key that runs already. Rejects as it does, or with the reason of
   *  `signal`. */
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

  /** Ends all of them: they reject. */
  close(): void {
    for (const [key, running] of this.#running) this.#end(key, running);
  }

  #start(key: string, request: (signal: AbortSignal) => Promise<unknown>): Running {
    const stop = new AbortController();
    const stopped = new Promise<never>((_, reject) => {
      stop.signal.addEventListener('abort', () => reject(stop.signal.reason));
    });
    const running: Running = { answer: Promise.race([request(stop.signal), stopped]), stop, waiting: 0 };
    running.answer.catch(() => {}); // who waits is told; perhaps nobody does
    this.#running.set(key, running);
    return running;
  }

  #end(key: string, running: Running): void {
    if (this.#running.get(key) === running) this.#running.delete(key);
    running.stop.abort(new PastError('away', 'nobody waits for it any more'));
  }
}
