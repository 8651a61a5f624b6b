import { type EventMessage, parseRelayMessage } from '@posecast/wire';
import { fieldsOf, type LaneAnswer, membersOf } from './answers.ts';

/** As many as a socket sends to a viewer who joins. */
const EVENTS_MAX = 100;
/** The ten minutes of the first loaded part, and the ten minutes before. */
const PAGES_MAX = 2;
const PAGE_MS = 600_000;
const EVENT_CHARS_MAX = 5000; // the wire allows 4096 bytes

/** What a part that does not follow the previous one says about the missing events. */
export interface Missing {
  /** The start of that part, unix ms. */
  readonly fromMs: number;
  /** The newest event before it, and the newest event of the same numbering that the page has received; 0: none. */
  readonly eventN: number;
  readonly toldN: number;
}

/** Finds the events in skipped parts, using the index of their ten minutes. Requests the same cacheable pages as everyone else,
 *  newest first, as long as events are missing. */
export class MissedEvents {
  readonly #missing: Missing;
  #pages = 0;
  /** Newest first, with decreasing numbers. */
  readonly #found: EventMessage[] = [];

  constructor(missing: Missing) {
    this.#missing = missing;
  }

  get toldN(): number {
    return this.#missing.toldN;
  }

  /** Oldest first. */
  get found(): EventMessage[] {
    return this.#found.toReversed();
  }

  /** The ten minutes whose index to read next, in address form; null: there is nothing more to find. */
  get page(): string | null {
    const { fromMs, eventN, toldN } = this.#missing;
    const oldestN = this.#found.at(-1)?.n ?? eventN + 1;
    if (this.#pages === PAGES_MAX || this.#found.length >= EVENTS_MAX || oldestN <= toldN + 1) return null;
    const pageMs = (Math.floor(fromMs / PAGE_MS) - this.#pages) * PAGE_MS;
    return `${new Date(pageMs).toISOString().slice(0, 16)}Z`;
  }

  /** Takes the index of `page`. If it was refused, the search ends. Malformed entries are skipped. */
  add(answer: LaneAnswer): void {
    this.#pages = answer.status === 200 ? this.#pages + 1 : PAGES_MAX;
    if (answer.status !== 200) return;
    const { fromMs, eventN, toldN } = this.#missing;
    // it may mix takes of two relays, and the numbering may have restarted
    const told = listEvents(answer)
      .filter(({ atMs }) => atMs < fromMs)
      .sort((a, b) => b.atMs - a.atMs || b.event.n - a.event.n);
    for (const { event } of told) {
      const beforeN = this.#found.at(-1)?.n ?? eventN + 1;
      if (event.n < beforeN && event.n > toldN && this.#found.length < EVENTS_MAX) this.#found.push(event);
    }
  }

  /** The events found and, if there are any, the open faults, which may have begun long before. Oldest first. */
  listWith(open: readonly EventMessage[]): EventMessage[] {
    if (this.#found.length === 0) return [];
    const byN = new Map([...open, ...this.#found].map((event) => [event.n, event]));
    return [...byN.values()].sort((a, b) => a.n - b.n);
  }
}

function listEvents(answer: LaneAnswer): { readonly atMs: number; readonly event: EventMessage }[] {
  const found: { readonly atMs: number; readonly event: EventMessage }[] = [];
  for (const segment of listOf(membersOf(answer).segments)) {
    for (const each of listOf(fieldsOf(segment).events)) {
      const atMs = fieldsOf(each).at_ms;
      const text = JSON.stringify(each);
      const event = text.length > EVENT_CHARS_MAX ? null : parseRelayMessage(text);
      if (typeof atMs === 'number' && event?.type === 'event') found.push({ atMs, event });
    }
  }
  return found;
}

function listOf(value: unknown): readonly unknown[] {
  return Array.isArray(value) ? value : [];
}
