/// <reference lib="webworker" />
import { nowMs } from './clock.ts';
import { Mailbox } from './mailbox.ts';
import type { FromStream, ToStream } from './messages.ts';
import { type Action, Session } from './session.ts';

/** The thread that owns the socket: it does what the session says, and tells the session what happened. */

const TICK_MS = 250;
/** The clock of the wall running ahead of ours by this much means that the machine slept. */
const SLEPT_MS = 2000;

declare const self: DedicatedWorkerGlobalScope;

type StateMessage = Extract<FromStream, { kind: 'state' }>;

const states = new Mailbox<StateMessage>();
let session: Session | null = null;
let socket: WebSocket | null = null;
let wallMinusClock = Date.now() - nowMs();

function post(message: FromStream): void {
  if (message.kind === 'state') {
    const now = states.put(message);
    if (now !== null) handOver(now);
    return;
  }
  if (message.kind === 'schema') states.clear(); // what waits is coded in the schema before
  self.postMessage(message);
}

function handOver(message: StateMessage): void {
  self.postMessage(message, [message.state.codes.buffer]);
}

function perform(actions: readonly Action[]): void {
  for (const action of actions) {
    switch (action.do) {
      case 'connect':
        connect(action.url);
        break;
      case 'send':
        if (socket?.readyState === WebSocket.OPEN) socket.send(action.text);
        break;
      case 'drop':
        drop();
        break;
      case 'post':
        post(action.message);
        break;
    }
  }
}

function connect(url: string): void {
  drop();
  let opened: WebSocket;
  try {
    opened = new WebSocket(url);
  } catch {
    perform(session?.closed(nowMs(), 1006, 'the address is not one for a stream') ?? []);
    return;
  }
  socket = opened;
  opened.binaryType = 'arraybuffer';
  const mine = () => socket === opened; // what an abandoned socket still says is nobody's business
  opened.onopen = () => mine() && perform(session?.opened(nowMs()) ?? []);
  opened.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
    if (!mine() || session === null) return;
    perform(
      typeof event.data === 'string'
        ? session.text(nowMs(), event.data)
        : session.binary(nowMs(), new Uint8Array(event.data)),
    );
  };
  opened.onclose = (event) => {
    if (!mine()) return;
    socket = null;
    perform(session?.closed(nowMs(), event.code, event.reason) ?? []);
  };
}

function drop(): void {
  const dropped = socket;
  socket = null;
  dropped?.close();
}

self.onmessage = (event: MessageEvent<ToStream>) => {
  const message = event.data;
  switch (message.kind) {
    case 'open':
      session = new Session(message.url, message.hz, message.visible, Math.random);
      perform(session.start(nowMs()));
      break;
    case 'taken': {
      const next = states.taken();
      if (next !== null) handOver(next);
      break;
    }
    case 'visible':
      perform(session?.visibility(nowMs(), message.visible) ?? []);
      break;
    case 'wake':
      perform(session?.wake(nowMs()) ?? []);
      break;
    case 'close':
      perform(session?.close() ?? []);
      self.close();
      break;
  }
};

setInterval(() => {
  const ahead = Date.now() - nowMs() - wallMinusClock;
  wallMinusClock += ahead;
  if (ahead > SLEPT_MS) perform(session?.wake(nowMs()) ?? []);
  perform(session?.tick(nowMs()) ?? []);
}, TICK_MS);
