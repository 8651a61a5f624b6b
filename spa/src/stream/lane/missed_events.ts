import { type EventMessage, parseRelayMessage } from '@posecast/wire';
import { fieldsOf } from '../../kit.ts';
import { type LaneAnswer, membersOf } from './answers.ts';

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

/** Newer events wait this long for missing earlier ones; those found later are still reported. */
const HOLD_MS = 5000;
/** The minimum interval between searches for missed events. */
const LOOK_EVERY_MS = 10_000;
/** If an index has not arrived by then, it is requested again. */
const ANSWER_MS = 30_000;
/** After a failure, the next request follows after at most this × 2^failures, and at least half of that. */
const RETRY_MS = 2000;
const RETRY_MS_MAX = 60_000;
/** About five minutes. */
const FAILURES_MAX = 9;

/** Decides when to request the index after events were missed, and repeats until it arrives, for some minutes at most. Pure;
 *  times are ms of the viewer's clock. */
export class LookBack {
  readonly #random: () => number;
  #missed: MissedEvents | null = null;
  /** When to send the next request, or to stop waiting. */
  #dueMs = Number.POSITIVE_INFINITY;
  #isAsked = false;
  #failures = 0;
  #beganMs = Number.NEGATIVE_INFINITY;
  /** Until when newer events wait. */
  heldMs = Number.POSITIVE_INFINITY;

  constructor(random: () => number) {
    this.#random = random;
  }

  get nextMs(): number {
    return Math.min(this.#dueMs, this.heldMs);
  }

  /** Events are missing, in addition to earlier ones not found yet. Returns whether newer events must wait: not if the page knows
   *  of no fault that could have ended meanwhile. */
  begin(missing: Missing, nowMs: number): boolean {
    const toldN = Math.min(missing.toldN, this.#missed?.toldN ?? missing.toldN);
    this.#missed = new MissedEvents({ ...missing, toldN });
    this.#beganMs = Math.max(nowMs, this.#beganMs + LOOK_EVERY_MS);
    this.resume(this.#beganMs);
    const holds = this.#beganMs === nowMs && missing.toldN > 0;
    if (holds) this.heldMs = nowMs + HOLD_MS;
    return holds;
  }

  /** Continues the search of an earlier lane. */
  resume(atMs: number): void {
    this.#failures = 0;
    this.#isAsked = false;
    this.heldMs = Number.POSITIVE_INFINITY;
    this.#dueMs = this.#missed === null ? Number.POSITIVE_INFINITY : atMs;
  }

  /** What to request now; null: nothing. */
  ask(nowMs: number): string | null {
    if (nowMs < this.#dueMs) return null;
    if (this.#isAsked) this.#fail(nowMs, 0);
    if (nowMs < this.#dueMs) return null;
    this.#isAsked = true;
    this.#dueMs = nowMs + ANSWER_MS;
    return this.#missed!.page;
  }

  /** Takes the answer; null: none. Returns the events found so far; null: nothing new. */
  take(nowMs: number, answer: LaneAnswer | null): MissedEvents | null {
    const missed = this.#missed;
    if (!this.#isAsked || missed === null) return null;
    if (answer === null || answer.status === 429 || answer.status >= 500) {
      this.#fail(nowMs, answer?.retryMs ?? 0);
      return null;
    }
    this.#isAsked = false;
    this.#failures = 0;
    missed.add(answer);
    const isAll = missed.page === null;
    this.#dueMs = isAll ? Number.POSITIVE_INFINITY : nowMs;
    if (isAll) this.#missed = null;
    return missed;
  }

  /** Newer events need not wait any longer. Returns what has been found for them. */
  letGo(): MissedEvents | null {
    this.heldMs = Number.POSITIVE_INFINITY;
    return this.#missed;
  }

  #fail(nowMs: number, retryMs: number): void {
    this.#isAsked = false;
    const mostMs = Math.min(RETRY_MS_MAX, RETRY_MS * 2 ** this.#failures);
    const waitMs = retryMs + mostMs * (0.5 + this.#random() / 2);
    this.#dueMs = ++this.#failures < FAILURES_MAX ? nowMs + waitMs : Number.POSITIVE_INFINITY;
  }
}
