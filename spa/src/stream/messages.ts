import type { EventMessage, Schema } from '@posecast/wire';
import type { Status } from '../twin/liveness.ts';
import type { RobotState } from '../twin/robot.ts';
import type { Transport } from './transport.ts';

/** Why a connection ended, in the close table's terms. */
export interface Ending {
  code: number;
  reason: string;
}

export type Phase = 'connecting' | 'open' | 'waiting' | 'ended';

/** Worker → page. Control messages are few (status once a second, events 20 a second at most); states pass a mailbox. */
export type FromStream =
  | { kind: 'link'; by: Transport; phase: Phase; retryAtMs: number | null; ending: Ending | null }
  | { kind: 'schema'; schema: Schema }
  | { kind: 'state'; state: RobotState }
  | { kind: 'status'; status: Status }
  | { kind: 'event'; event: EventMessage }
  | { kind: 'info'; kv: ReadonlyMap<string, string> }
  | { kind: 'model'; hash: string | null }
  /** What the relay granted; `reason` when it is less than was asked. */
  | { kind: 'rate'; hz: number; reason: string | null }
  /** Measured: frames a second, and the round trip to the relay (null until known). */
  | { kind: 'pace'; hz: number; roundTripMs: number | null }
  | { kind: 'problem'; problem: Problem };

/** What keeps the stream from being understood. `newer`: the relay speaks another wire format. */
export interface Problem {
  readonly what: 'newer' | 'schema' | 'worker';
  /** In English: for who builds the robot. */
  readonly detail: string;
}

/** Page → worker. */
export type ToStream =
  | {
      kind: 'open';
      url: string;
      hz: number;
      visible: boolean;
      token: string | undefined;
      /** What the page's clock counts of sleep (`clock.ts`). */
      sleptMs: number;
    }
  | { kind: 'taken' }
  /** A newer token, another one, or none any more. */
  | { kind: 'token'; token: string | undefined }
  | { kind: 'visible'; visible: boolean }
  /** Something changed outside (back online, back from sleep, the person asks): try now rather than later. */
  | { kind: 'wake'; sleptMs: number }
  /** A rate that was lowered is asked for in full again. */
  | { kind: 'wish-all' }
  | { kind: 'close' };

/** What the worker must do for its session, in this order. */
export type Action =
  | { do: 'connect'; by: Transport; url: string }
  /** Open a WebSocket beside what stands; if it opens, it takes over. */
  | { do: 'try'; url: string }
  | { do: 'send'; text: string }
  | { do: 'drop' }
  | { do: 'post'; message: FromStream };
