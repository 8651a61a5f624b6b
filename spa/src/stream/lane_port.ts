import type { EventMessage } from '@posecast/wire';
import type { FromStream } from './messages.ts';

/** The interface between the worker and the lane (`lane/open_lane.ts`), which is loaded on demand. */

/** The newest frame that the page has shown. */
export interface ShownFrame {
  readonly schemaId: number;
  readonly seq: number;
  readonly tS: number;
  /** When a socket delivered it, or would have, viewer's clock. */
  readonly atMs: number;
}

/** The position of an event among those of its relay. */
export type EventMark = Pick<EventMessage, 'n' | 'at'>;

/** What the page already knows. */
export interface KnownBefore {
  readonly frame: ShownFrame | null;
  readonly event: EventMark | null;
  /** The events with which open faults began. */
  readonly faults: readonly EventMessage[];
}

/** Callbacks and settings of a lane. */
export interface LaneHandlers {
  /** Passed in, not imported, because the lane is bundled separately. */
  nowMs(): number;
  readonly hz: number;
  readonly isVisible: boolean;
  readonly before: KnownBefore;
  post(message: FromStream): void;
  /** The relay has answered. */
  opened(): void;
  /** The lane has ended. The code is from the close table (wire/SPEC.md), or 1006. */
  closed(code: number, reason: string): void;
}

/** A running lane. */
export interface OpenLane {
  setVisible(isVisible: boolean): void;
  /** Something changed outside: the wait after a failure is cut short. */
  wake(): void;
  close(): void;
}
