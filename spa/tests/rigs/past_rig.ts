import type { Schema } from '@posecast/wire';
import { RelayPast } from '../../src/past/relay/relay_past.ts';

/** A page's clock, far from the relay's, whose timers run when it is advanced. */
export class PageClock {
  nowMs = 5000;
  #timers: { atMs: number; run: () => void }[] = [];

  readonly later = (ms: number, run: () => void): (() => void) => {
    const timer = { atMs: this.nowMs + ms, run };
    this.#timers.push(timer);
    return () => {
      this.#timers = this.#timers.filter((each) => each !== timer);
    };
  };

  get waiting(): number {
    return this.#timers.length;
  }

  /** Advances the time, and lets everything happen that waits for no longer than that. */
  async pass(ms: number): Promise<void> {
    const untilMs = this.nowMs + ms;
    for (;;) {
      await settled();
      const next = this.#timers.filter(({ atMs }) => atMs <= untilMs).sort((a, b) => a.atMs - b.atMs)[0];
      if (next === undefined) break;
      this.#timers = this.#timers.filter((each) => each !== next);
      this.nowMs = next.atMs;
      next.run();
    }
    this.nowMs = untilMs;
  }
}

/** Resolves when everything that waits for no timer has happened. */
export async function settled(): Promise<void> {
  for (let i = 0; i < 10; i++) await new Promise((resolve) => setImmediate(resolve));
}

export const json = (value: unknown, status = 200) =>
  new Response(typeof value === 'string' ? value : JSON.stringify(value), {
    status,
    headers: { 'content-type': 'application/json' },
  });

export const BASE = 'https://relay.example/api/v1/robots/demo/past';

/** A `RelayPast` with answers given by a test: by path, including the query. Other paths are 404. */
export class PastRig {
  readonly clock = new PageClock();
  readonly answers = new Map<string, (init: RequestInit) => Response | Promise<Response>>();
  /** The paths requested since `asked` was read. */
  #asked: string[] = [];
  hidden = false;
  liveSchema: Schema | null = null;
  token: string | undefined;
  headers: HeadersInit | undefined;

  open(): RelayPast {
    return new RelayPast(BASE, {
      fetch: async (url, init) => {
        const path = url.slice(BASE.length);
        this.#asked.push(path);
        this.headers = init.headers;
        const answer = this.answers.get(path);
        if (answer === undefined) return json({ detail: 'no' }, 404);
        const ended = new Promise<never>((_, reject) => {
          init.signal?.addEventListener('abort', () => reject(init.signal?.reason));
        });
        return Promise.race([answer(init), ended]);
      },
      tokenFor: () => this.token,
      nowMs: () => this.clock.nowMs,
      later: this.clock.later,
      liveSchema: () => this.liveSchema,
      isIdle: () => this.hidden,
    });
  }

  answer(path: string, value: unknown, status = 200): void {
    this.answers.set(path, () => json(value, status));
  }

  /** The paths requested since the last call. */
  takeAsked(): string[] {
    const asked = this.#asked;
    this.#asked = [];
    return asked;
  }
}

export const HASH = 'ab'.repeat(32);
export const TAKE = '8f14e45fceea167a';

/** A segment as in the relay's index, of four seconds unless stated otherwise. */
export function entry(index: number, fromMs: number, more: Readonly<Record<string, unknown>> = {}) {
  return {
    ...{ take: TAKE, index, run: '00f0a1b2c3d4e5f6', from_ms: fromMs, to_ms: fromMs + 4000 },
    ...{ frames: 120, first_seq: 0, last_seq: 119, bytes: 8000, sha256: HASH, schema: HASH, model: null },
    ...{ missing: 0, words: [{ at_ms: fromMs, word: 'online' }], events: [] },
    ...more,
  };
}

export function event(n: number, atMs: number, more: Readonly<Record<string, unknown>> = {}) {
  const what = { type: 'event', n, t: n, at: atMs / 1000, level: 'fault', source: 'RKN', text: 'bigError' };
  return { at_ms: atMs, ...what, state: 'on', ...more };
}

export function summary(fromMs: number, toMs: number, more: Readonly<Record<string, unknown>> = {}) {
  const days = [...new Set([fromMs, toMs].map((atMs) => new Date(atMs).toISOString().slice(0, 10)))];
  const newest = { take: TAKE, index: 1 };
  return {
    view: 'public',
    from_ms: fromMs,
    to_ms: toMs,
    past_ms: 1_800_000,
    delay_ms: 0,
    newest,
    days,
    ...more,
  };
}

export function minute(at: string, more: Readonly<Record<string, unknown>> = {}) {
  return { minute: at, bytes: 60_000, frames: 1800, word: 'online', faults: 0, ...more };
}
