import type { EventMessage } from '@posecast/wire';
import type { FromStream } from './messages.ts';

/** What crosses between the worker and the lane (`lane/open_lane.ts`), which is loaded when it is needed. */

/** The newest frame that the page has shown. */
export interface ShownFrame {
  readonly schemaId: number;
  readonly seq: number;
  readonly tS: number;
  /** When a socket brought it, or would have, viewer's clock. */
  readonly atMs: number;
}

/** Where an event stands among those of its relay. */
export type EventMark = Pick<EventMessage, 'n' | 'at'>;

/** What the page knows from before. */
export interface KnownBefore {
  readonly frame: ShownFrame | null;
  readonly event: EventMark | null;
  /** The events with which open faults began. */
  readonly faults: readonly EventMessage[];
}

/** Callbacks and settings of a lane. */
export interface LaneHandlers {
  /** Passed in, not imported: the lane is bundled by itself. */
  nowMs(): number;
  readonly hz: number;
  readonly isVisible: boolean;
  readonly before: KnownBefore;
  post(message: FromStream): void;
  /** The relay has answered. */
  opened(): void;
  /** Nothing more comes. The code is one of the close table (wire/SPEC.md), or 1006. */
  closed(code: number, reason: string): void;
}

/** A lane that runs. */
export interface OpenLane {
  setVisible(isVisible: boolean): void;
  /** Something has changed outside: a failure is not waited out. */
  wake(): void;
  close(): void;
}
