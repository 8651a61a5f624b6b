import { Schema } from '@posecast/wire';
import type { RobotTwin } from '../twin/robot.ts';
import { nowMs } from './clock.ts';
import type { Ending, FromStream, Phase, ToStream } from './messages.ts';

/** The connection as the page tells of it. A new object at every change, so that a listener can compare. */
export interface Link {
  phase: Phase;
  retryAtMs: number | null;
  ending: Ending | null;
  /** What the relay granted, and why it is less than was asked. */
  grantedHz: number | null;
  rateReason: string | null;
  /** Measured. */
  hz: number;
  roundTripMs: number | null;
  problem: string | null;
}

const UNKNOWN: Link = {
  phase: 'connecting',
  retryAtMs: null,
  ending: null,
  grantedHz: null,
  rateReason: null,
  hz: 0,
  roundTripMs: null,
  problem: null,
};

/** The page's end of the stream: starts the worker, writes what it says into the twin, tells it what the page sees. */
export class StreamClient {
  link: Link = UNKNOWN;
  readonly #twin: RobotTwin;
  readonly #worker: Worker;
  readonly #listeners = new Set<() => void>();
  readonly #leave = new AbortController();

  constructor(twin: RobotTwin, url: string, hz: number) {
    this.#twin = twin;
    this.#worker = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module', name: 'stream' });
    this.#worker.onmessage = (event: MessageEvent<FromStream>) => this.#accept(event.data);
    this.#worker.onerror = (event) => {
      this.#set({
        problem: `The stream stopped: ${event.message || 'its worker could not start'}. Reload the page.`,
      });
    };
    this.#tell({ kind: 'open', url, hz, visible: !document.hidden });
    twin.acceptWatching(!document.hidden, nowMs());
    const { signal } = this.#leave;
    const wake = () => this.wake();
    document.addEventListener(
      'visibilitychange',
      () => {
        this.#tell({ kind: 'visible', visible: !document.hidden });
        twin.acceptWatching(!document.hidden, nowMs());
        if (!document.hidden) wake();
      },
      { signal },
    );
    window.addEventListener('online', wake, { signal });
    window.addEventListener('pageshow', (event) => event.persisted && wake(), { signal });
  }

  onChange(listener: () => void): () => void {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  }

  /** Try now rather than later. */
  wake(): void {
    this.#tell({ kind: 'wake' });
  }

  close(): void {
    this.#leave.abort();
    this.#worker.onmessage = null;
    this.#tell({ kind: 'close' });
  }

  #tell(message: ToStream): void {
    this.#worker.postMessage(message);
  }

  #accept(message: FromStream): void {
    const twin = this.#twin;
    switch (message.kind) {
      case 'state':
        twin.acceptState(message.state);
        this.#tell({ kind: 'taken' });
        return;
      case 'status':
        twin.acceptStatus(message.status);
        return;
      case 'schema':
        twin.acceptSchema(Schema.parse(message.text)); // the worker has parsed the same text before
        this.#set({ problem: null });
        return;
      case 'event':
        twin.acceptEvent(message.event);
        return;
      case 'info':
        twin.acceptInfo(message.kv);
        return;
      case 'model':
        twin.acceptModel(message.hash);
        return;
      case 'rate':
        this.#set({ grantedHz: message.hz, rateReason: message.reason });
        return;
      case 'pace':
        this.#set({ hz: message.hz, roundTripMs: message.roundTripMs });
        return;
      case 'link':
        twin.acceptConnection(message.phase === 'open', nowMs());
        this.#set({
          phase: message.phase,
          retryAtMs: message.retryAtMs,
          ending: message.phase === 'open' ? null : (message.ending ?? this.link.ending),
        });
        return;
      case 'problem':
        this.#set({ problem: message.text });
        return;
    }
  }

  #set(changed: Partial<Link>): void {
    this.link = { ...this.link, ...changed };
    for (const listener of this.#listeners) listener();
  }
}
