/// <reference lib="webworker" />
import { WIRE_VERSION } from '@posecast/wire';
import { nowMs, setSlept } from './clock.ts';
import { Mailbox } from './mailbox.ts';
import type { Action, FromStream, ToStream } from './messages.ts';
import { Session } from './session.ts';
import type { StreamEvent } from './sse.ts';

/** The worker thread that owns the socket: it performs the session's actions and reports events to the session. */

const TICK_MS = 250;

declare const self: DedicatedWorkerGlobalScope;

type StateMessage = Extract<FromStream, { kind: 'state' }>;

const states = new Mailbox<StateMessage>();
let session: Session | null = null;
let socket: WebSocket | null = null;
/** A WebSocket that is tried while server-sent events carry the stream. */
let trial: WebSocket | null = null;
let events: { close(): void } | null = null;
let token: string | undefined;

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
        if (action.by === 'websocket') connect(action.url);
        else read(action.url, action.by === 'mirror');
        break;
      case 'try':
        attempt(action.url);
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
  opened.onopen = () => socket === opened && perform(session?.opened(nowMs()) ?? []);
  own(opened);
}

function own(opened: WebSocket): void {
  socket = opened;
  opened.binaryType = 'arraybuffer';
  const mine = () => socket === opened; // events of an abandoned socket are ignored
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

/** Opens events or a mirror. Their readers are loaded on demand, because most viewers need neither. */
function read(url: string, mirrored: boolean): void {
  drop();
  const mine = { close: () => {} };
  events = mine;
  const unlessLeft = (then: (session: Session) => readonly Action[]) => {
    if (events === mine && session !== null) perform(then(session));
  };
  (mirrored ? import('./firebase_mirror.ts') : import('./sse.ts')).then(
    ({ openEventStream, frameBytes }) => {
      if (events !== mine) return;
      const hear = ({ name, data, writtenMs }: StreamEvent) =>
        unlessLeft((to) => {
          if (Number.isFinite(writtenMs)) to.stamped(nowMs(), writtenMs);
          const frame = name === 'frame' ? frameBytes(data) : null;
          return frame === null ? to.text(nowMs(), data) : to.binary(nowMs(), frame);
        });
      mine.close = openEventStream(url, token, {
        nowMs,
        wireVersion: WIRE_VERSION,
        opened: () => unlessLeft((to) => to.opened(nowMs())),
        heard: () => unlessLeft((to) => to.heard(nowMs())),
        event: hear,
        closed: (code, reason) =>
          unlessLeft((to) => {
            events = null;
            return to.closed(nowMs(), code, reason);
          }),
      }).close;
    },
    () => unlessLeft((to) => to.closed(nowMs(), 1006, 'the reader of events did not come')),
  );
}

/** One at a time; one that does not open is replaced by the next. */
function attempt(url: string): void {
  trial?.close();
  const tried = new WebSocket(url);
  trial = tried;
  tried.onopen = () => {
    if (trial !== tried || session === null) return;
    trial = null; // so that it is not dropped
    drop();
    own(tried);
    perform(session.moved(nowMs()));
  };
}

function drop(): void {
  const dropped = [socket, trial, events];
  socket = trial = events = null;
  for (const one of dropped) one?.close();
}

self.onmessage = (event: MessageEvent<ToStream>) => {
  const message = event.data;
  switch (message.kind) {
    case 'open':
      setSlept(message.sleptMs);
      token = message.token;
      session = new Session(message.url, message.hz, message.visible, Math.random, message.token);
      perform(session.start(nowMs()));
      break;
    case 'taken': {
      const next = states.taken();
      if (next !== null) handOver(next);
      break;
    }
    case 'token':
      token = message.token;
      perform(session?.renew(nowMs(), token) ?? []);
      break;
    case 'visible':
      perform(session?.visibility(nowMs(), message.visible) ?? []);
      break;
    case 'doubt':
      perform(session?.doubt(nowMs(), message.sinceMs) ?? []);
      break;
    case 'wake':
      setSlept(message.sleptMs);
      perform(session?.wake(nowMs()) ?? []);
      break;
    case 'wish-all':
      perform(session?.wishAll(nowMs()) ?? []);
      break;
    case 'close':
      perform(session?.close() ?? []);
      self.close();
      break;
  }
};

setInterval(() => perform(session?.tick(nowMs()) ?? []), TICK_MS);
