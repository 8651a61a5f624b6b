import { type EventMessage, parseRelayMessage } from '@posecast/wire';
import type { EventMark } from '../lane_port.ts';

/** Selects the events that the page does not have yet. The page takes a number that goes back in time to mean that the relay lost
 *  count, so an old event must not be repeated. */
export class ToldEvents {
  #newest: EventMark | null;

  /** `newest`: the newest event that the page already has. */
  constructor(newest: EventMark | null) {
    this.#newest = newest;
  }

  /** The time of the newest known event, unix ms; 0: none. */
  get newestMs(): number {
    return 1000 * (this.#newest?.at ?? 0);
  }

  /** The event, unless it is known or older than the known ones. */
  take(event: EventMessage): EventMessage | null {
    const newest = this.#newest;
    if (newest !== null) {
      const [at, before] = [event.at ?? 0, newest.at ?? 0];
      if (at < before || (at === before && event.n <= newest.n)) return null;
    }
    this.#newest = event;
    return event;
  }
}

/** An event given as text in a part; null if it is invalid. */
export function eventOf(text: string): EventMessage | null {
  const event = parseRelayMessage(text);
  return event?.type === 'event' ? event : null;
}
