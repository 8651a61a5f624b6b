import { tokenFor } from '../auth/token.ts';
import { countSleep } from './clock.ts';
import type { FromStream, ToStream } from './messages.ts';

/**
 * A stream's worker, started before the page that reads it is there: on a slow line the page's own code is a second
 * away, and the connection and the first frames need not wait for it. What the worker says meanwhile is kept.
 */
export interface StartedStream {
  readonly worker: Worker;
  /** What the worker has said so far, oldest first. */
  readonly messages: readonly FromStream[];
}

/** When so many messages wait, the page that would take them is not coming: worker and messages are dropped. */
const MAX_MESSAGES = 200;

let early: { readonly url: string; readonly worker: Worker; readonly messages: FromStream[] } | null = null;

/** Starts the stream of an address; `onModel` is called with every model hash that comes before the page. */
export function startEarly(url: string, hz: number, onModel: (hash: string) => void): void {
  abandon();
  const worker = start(url, hz);
  const messages: FromStream[] = [];
  early = { url, worker, messages };
  worker.onmessage = ({ data }: MessageEvent<FromStream>) => {
    messages.push(data);
    if (data.kind === 'model' && data.hash !== null) onModel(data.hash);
    if (messages.length > MAX_MESSAGES) abandon();
  };
  worker.onerror = abandon; // the page starts another, and tells if that fails, too
}

/** The stream of an address: the one that was started early, or a new one. */
export function takeStream(url: string, hz: number): StartedStream {
  const taken = early;
  if (taken?.url !== url) {
    abandon();
    return { worker: start(url, hz), messages: [] };
  }
  early = null;
  return taken;
}

function start(url: string, hz: number): Worker {
  const worker = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module', name: 'stream' });
  const token = tokenFor(url);
  const visible = !document.hidden;
  worker.postMessage({ kind: 'open', url, hz, visible, token, sleptMs: countSleep() } satisfies ToStream);
  return worker;
}

function abandon(): void {
  early?.worker.terminate();
  early = null;
}
