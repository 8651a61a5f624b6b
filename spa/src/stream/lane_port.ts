import type { EventMessage } from '@posecast/wire';
import { dropOldest } from '../kit.ts';
import { causeOf } from '../twin/names.ts';
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

/** The maximum that a part lists; if there are more, the oldest are missing (wire/SPEC.md §10). */
export const FAULTS_MAX = 100;

/** The faults that the page considers open, from the events that it has received. */
export class ToldFaults {
  readonly #open = new Map<string, EventMessage>();

  get open(): EventMessage[] {
    return [...this.#open.values()];
  }

  record(event: EventMessage): void {
    const cause = causeOf(event);
    this.#open.delete(cause);
    if (event.state !== 'on') return;
    this.#open.set(cause, event);
    dropOldest(this.#open, FAULTS_MAX);
  }
}
