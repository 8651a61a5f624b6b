import { tokenFor } from '../relay/token.ts';
import { countSleep } from './clock.ts';
import type { FromStream, ToStream } from './messages.ts';
import workerUrl from './worker.ts?worker&url';

/**
 * A stream's worker, started before the page's own code has loaded: on a slow connection that takes a second, and connecting need
 * not wait for it. Messages that arrive meanwhile are kept.
 */
export interface StartedStream {
  readonly worker: Worker;
  /** The worker's messages so far, oldest first. */
  readonly messages: readonly FromStream[];
}

/** If more messages than this are waiting, the page is assumed to have failed: worker and messages are dropped. */
const MAX_MESSAGES = 200;

/** Imports the worker's script, and gives it the messages that arrived meanwhile. Not a module, because Chromium starts none of
 *  those from a blob of a page without an origin. */
const IMPORTER = `const held = [];
onmessage = (event) => held.push(event);
import(${JSON.stringify(workerUrl)}).then(
  () => held.forEach((event) => onmessage(event)),
  (error) => setTimeout(() => { throw error; }),
);`;

let early: {
  readonly url: string;
  readonly lane: string | null;
  readonly worker: Worker;
  readonly messages: FromStream[];
} | null = null;

/** Starts the stream at `url` early. `onModel` gets every model hash that arrives before the page takes over. `lane`: where
 *  segments are read instead (see `ToStream`). */
export function startEarly(
  url: string,
  hz: number,
  onModel: (hash: string) => void,
  lane: string | null = null,
): void {
  const worker = start(url, hz, lane);
  const messages: FromStream[] = [];
  early = { url, lane, worker, messages };
  worker.onmessage = ({ data }: MessageEvent<FromStream>) => {
    messages.push(data);
    if (data.kind === 'model' && data.hash !== null) onModel(data.hash);
    if (messages.length > MAX_MESSAGES) abandon();
  };
  worker.onerror = abandon; // the page starts another one, and reports if that fails too
}

/** Hands over the stream at `url`: the early one if it has the same address and lane, else a new one. */
export function takeStream(url: string, hz: number, lane: string | null = null): StartedStream {
  const taken = early;
  if (taken?.url !== url || taken.lane !== lane) {
    abandon();
    return { worker: start(url, hz, lane), messages: [] };
  }
  early = null;
  return taken;
}

/** A worker that has loaded and waits for a stream. */
let spare: Worker | null = null;

/** Loads a worker for the next stream ahead of time, so that a robot's numbers need not wait for its code. */
export function prepareStream(): void {
  if (spare !== null) return;
  const worker = load();
  worker.onerror = () => {
    if (spare === worker) spare = null;
  };
  spare = worker;
}

/** A page may start only workers of its own origin. A frame with `sandbox` has none: there, a worker that it makes itself imports
 *  the real one. */
function load(): Worker {
  if (globalThis.origin !== 'null') return new Worker(workerUrl, { type: 'module', name: 'stream' });
  const url = URL.createObjectURL(new Blob([IMPORTER], { type: 'text/javascript' }));
  return new Worker(url, { name: 'stream' });
}

function start(url: string, hz: number, lane: string | null): Worker {
  const worker = spare ?? load();
  spare = null;
  worker.onerror = null;
  const token = tokenFor(url);
  const visible = !document.hidden;
  const sleptMs = countSleep();
  worker.postMessage({ kind: 'open', url, hz, visible, token, lane, sleptMs } satisfies ToStream);
  return worker;
}

function abandon(): void {
  early?.worker.terminate();
  early = null;
}
