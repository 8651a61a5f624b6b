/// <reference lib="webworker" />
import { WIRE_VERSION } from '@posecast/wire';
import { nowMs, setSlept } from './clock.ts';
import { Mailbox, Overlap } from './frame_reader.ts';
import laneUrl from './lane/lane_script.ts?worker&url';
import {
  type EventMark,
  type LaneHandlers,
  type OpenLane,
  type ShownFrame,
  ToldFaults,
} from './lane_port.ts';
import type { Action, FromStream, ToStream } from './messages.ts';
import { Session } from './session.ts';
import type { EventStream, StreamEvent } from './sse.ts';
import { type Transport, tryWebSocket } from './transport.ts';

/** The worker thread that owns the socket: it performs the session's actions and reports events to the session. */

const TICK_MS = 250;

declare const self: DedicatedWorkerGlobalScope & {
  /** From `lane/lane_script.ts`, once that is loaded. */
  lane: {
    openEventStream(url: string, token: unknown, handlers: LaneHandlers): OpenLane;
    /** It posts on its own. */
    deliver(): never;
  };
};

type StateMessage = Extract<FromStream, { kind: 'state' }>;

const states = new Mailbox<StateMessage>();
let session: Session | null = null;
let socket: WebSocket | null = null;
/** A WebSocket tried in parallel while server-sent events or segments carry the stream. */
let trial: WebSocket | null = null;
/** The stream that runs instead of a WebSocket. */
let events: ({ close(): void } & Partial<OpenLane> & Partial<EventStream>) | null = null;
let token: string | undefined;
let visible = true;
let wantedHz = 0;
/** What the page has been shown, for handing over from a socket to a lane and back. */
let behindMs = 0;
let shown: ShownFrame | null = null;
let told: EventMark | null = null;
const faults = new ToldFaults();
/** After a lane, and after a relay that was replaced: filters what the next socket repeats. */
const overlap = new Overlap();

function post(message: FromStream): void {
  if (message.kind === 'behind') behindMs = message.ms ?? 0;
  if (message.kind === 'event') {
    told = message.event;
    faults.record(message.event);
  }
  if (message.kind === 'state') {
    if (overlap.isShown(message.state)) return;
    shown = message.state;
    const now = states.put(message);
    if (now !== null) handOver(now);
    return;
  }
  if (message.kind === 'schema') states.clear(); // the waiting items are coded in the previous schema
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
        else read(action.url, action.by);
        break;
      case 'try':
        attempt(action.url);
        break;
      case 'send':
        if (socket?.readyState === WebSocket.OPEN) socket.send(action.text);
        break;
      case 'ask':
        events?.ask?.(action.url);
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
  overlap.begin(session?.moves ? shown : null);
  let opened: WebSocket;
  try {
    opened = new WebSocket(url);
  } catch {
    perform(session?.closed(nowMs(), 1006, 'no address') ?? []);
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

/** Opens events, a mirror or segments. Their readers are loaded on demand, because most viewers need none of them. */
function read(url: string, by: Transport): void {
  drop();
  const mine = { close: () => {} };
  events = mine;
  const unlessLeft = (then: (session: Session) => readonly Action[]) => {
    if (events === mine && session !== null) perform(then(session));
  };
  (by === 'mirror'
    ? import('./firebase_mirror.ts')
    : by === 'events'
      ? import('./sse.ts')
      : import(/* @vite-ignore */ laneUrl).then(() => self.lane)
  ).then(
    ({ openEventStream, deliver }) => {
      if (events !== mine) return;
      const handlers = {
        nowMs,
        wireVersion: WIRE_VERSION,
        hz: wantedHz,
        isVisible: visible,
        before: {
          frame: shown && { ...shown, atMs: shown.atMs - behindMs },
          event: told,
          faults: faults.open,
        },
        opened: () => unlessLeft((to) => to.opened(nowMs())),
        heard: () => unlessLeft((to) => to.heard(nowMs())),
        clock: (askedMs: number, text: string) => unlessLeft((to) => to.clock(nowMs(), askedMs, text)),
        event: (event: StreamEvent) => unlessLeft((to) => deliver(event, nowMs(), to)),
        post: (message: FromStream) => events === mine && post(message),
        closed: (code: number, reason: string) =>
          unlessLeft((to) => {
            events = null;
            return to.closed(nowMs(), code, reason);
          }),
      };
      Object.assign(mine, openEventStream(url, token, handlers));
    },
    () => unlessLeft((to) => to.closed(nowMs(), 1006, 'no reader')),
  );
}

/** Tries a WebSocket in parallel, one at a time. It takes over once the relay has accepted it. */
function attempt(url: string): void {
  trial?.close();
  const accepted: Parameters<typeof tryWebSocket>[2] = (tried, heard) => {
    if (trial !== tried || session === null) return;
    trial = null; // so that it is not closed
    overlap.begin(shown);
    drop();
    own(tried);
    perform(session.moved(nowMs()));
    for (const each of heard) tried.onmessage?.(each);
  };
  try {
    const tried = tryWebSocket(url, token, accepted, (retryS) => {
      if (trial === tried) session?.refused(nowMs(), retryS);
    });
    trial = tried;
  } catch {
    trial = null; // not an address for sockets here
  }
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
      ({ token, visible } = message);
      wantedHz = message.hz;
      session = new Session(message.url, wantedHz, visible, Math.random, token, message.lane ?? undefined);
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
      visible = message.wanted;
      events?.setVisible?.(visible);
      perform(session?.visibility(nowMs(), visible, message.seen) ?? []);
      break;
    case 'doubt':
      perform(session?.doubt(nowMs(), message.sinceMs) ?? []);
      break;
    case 'wake':
      setSlept(message.sleptMs);
      events?.wake?.();
      perform(session?.wake(nowMs(), message.isAsked) ?? []);
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
