import type { EventMessage, Schema } from '@posecast/wire';
import type { Status } from '../twin/liveness.ts';
import type { RobotState } from '../twin/robot.ts';
import type { Transport } from './transport.ts';

/** Why a connection ended: a WebSocket close code (see the close table in wire/SPEC.md) and a reason in words. */
export interface Ending {
  code: number;
  reason: string;
}

/** `waiting`: for the next retry. `ended`: no further try unless the viewer asks. */
export type Phase = 'connecting' | 'open' | 'waiting' | 'ended';

/** Messages from the worker to the page. Most are rare (status once a second, events 20 a second at most); states,
 *  which come at frame rate, pass through a `Mailbox`. */
export type FromStream =
  /** `moves`: a relay that is being replaced has sent the page away, and its data is not old yet. */
  | {
      kind: 'link';
      by: Transport;
      phase: Phase;
      retryAtMs: number | null;
      ending: Ending | null;
      moves: boolean;
    }
  | { kind: 'schema'; schema: Schema }
  | { kind: 'state'; state: RobotState }
  | { kind: 'status'; status: Status }
  | { kind: 'event'; event: EventMessage }
  /** Earlier events that are reported late. `isAll`: none is missing any more. */
  | { kind: 'earlier'; events: readonly EventMessage[]; isAll: boolean }
  | { kind: 'info'; kv: ReadonlyMap<string, string> }
  | { kind: 'model'; hash: string | null }
  /** The granted rate; `reason` if it is lower than requested. */
  | { kind: 'rate'; hz: number; reason: string | null }
  /** Measured: frames a second, the round trip to the relay, and how late its data is at most (null until known). */
  | { kind: 'pace'; hz: number; roundTripMs: number | null; lateMs: number | null }
  /** The stream's own thread did not run between these times. */
  | { kind: 'held-up'; fromMs: number; toMs: number }
  /** The delay of the picture, ms; null: none. */
  | { kind: 'behind'; ms: number | null }
  | { kind: 'problem'; problem: Problem };

/** Why the stream can't be read. `newer`: the relay speaks another version of the wire format. */
export interface Problem {
  readonly what: 'newer' | 'schema' | 'worker';
  /** In English, for the robot's developer. */
  readonly detail: string;
}

/** Messages from the page to the worker. */
export type ToStream =
  | {
      kind: 'open';
      url: string;
      hz: number;
      visible: boolean;
      token: string | undefined;
      /** The address to read segments from instead of opening a socket, without a token: `…/api/v1/robots/{robot}/past`. null: a
       *  socket. */
      lane: string | null;
      /** How long the device has slept, as counted by the page's clock (`clock.ts`), ms. */
      sleptMs: number;
    }
  /** The page has taken the last state and is ready for the next. */
  | { kind: 'taken' }
  /** The token has been renewed, replaced or removed. */
  | { kind: 'token'; token: string | undefined }
  /** `wanted`: somebody looks at the live picture. `seen`: somebody sees the page, be it the past. */
  | { kind: 'visible'; wanted: boolean; seen: boolean }
  /** The page stopped calling its pose live at `sinceMs`. */
  | { kind: 'doubt'; sinceMs: number }
  /** Something changed outside (back online, back from sleep, the viewer asks): try now. `isAsked`: the viewer asks. */
  | { kind: 'wake'; sleptMs: number; isAsked: boolean }
  /** Request the full frame rate again after it was lowered. */
  | { kind: 'wish-all' }
  | { kind: 'close' };

/** An action that a `Session` requests from its worker; a list of actions is performed in order. */
export type Action =
  /** `segments`: the address of the lane and, if a relay named it, after a space that of the stream. */
  | { do: 'connect'; by: Transport; url: string }
  /** Open a WebSocket beside the current connection; if it opens, it takes over. */
  | { do: 'try'; url: string }
  | { do: 'send'; text: string }
  /** Ask for the relay's clock at this address, beside the stream. */
  | { do: 'ask'; url: string }
  | { do: 'drop' }
  | { do: 'post'; message: FromStream };
