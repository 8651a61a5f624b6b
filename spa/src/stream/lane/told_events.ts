import { type EventMessage, parseRelayMessage } from '@posecast/wire';
import type { EventMark } from '../lane_port.ts';

/** Picks the events that the page has not been told. A number that falls back in time means to it that the relay has lost
 *  count, so an old one must not come again. */
export class ToldEvents {
  #newest: EventMark | null;

  /** `newest`: the newest event that the page was told before. */
  constructor(newest: EventMark | null) {
    this.#newest = newest;
  }

  /** When the newest event was that is known, unix ms; 0: none is. */
  get newestMs(): number {
    return 1000 * (this.#newest?.at ?? 0);
  }

  /** The event, unless it is known or older than what is known. */
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

/** The event that a part has as a text; null if it is none. */
export function eventOf(text: string): EventMessage | null {
  const event = parseRelayMessage(text);
  return event?.type === 'event' ? event : null;
}
