import { type EventMessage, parseRelayMessage, type RobotStatus } from '@posecast/wire';
import { PastError, type SegmentRef } from '../past_source.ts';
import { DAY_MS, PAGE_MS, type Span } from '../past_types.ts';

/** Reads the relay's answers about the past; see *The past* in `docs/reference/protocol.md`. Anything that deviates from it is a
 *  `PastError` ('damaged') that names the place; it contains none of the relay's own text. */

/** Maximum entries in one page; a robot makes at most one segment a second. */
export const SEGMENTS_MAX = 5000;

const FIRST_MS = Date.UTC(2000);
const LAST_MS = Date.UTC(2100); // addresses allow no later day
const SEGMENT_MS_MAX = PAGE_MS; // the format can't hold a longer one
const EVENT_CHARS_MAX = 5000; // the wire allows 4096 bytes
const DAYS_MAX = 4000;
const MINUTES_MAX = 1440;
const DELETED_MAX = 1000;
const COUNT_MAX = 2 ** 48;
const VIEW = /^[a-z0-9][a-z0-9-]{0,62}$/;
const WORDS: readonly RobotStatus[] = ['online', 'silent', 'offline'];

/** How far back the page may look. */
export interface PastSummary {
  readonly view: string;
  readonly fromMs: number;
  readonly toMs: number;
  readonly pastMs: number;
  /** The starts of the days (UTC) with data, newest first. */
  readonly daysMs: readonly number[];
}

/** The spans of a view in which everything was deleted. */
export interface PastDeletions {
  readonly view: string;
  readonly spans: readonly Span[];
}

/** What started in a minute. */
export interface PastMinute {
  readonly atMs: number;
  readonly bytes: number;
  readonly frames: number;
  /** The most severe one. */
  readonly word: RobotStatus;
  readonly faults: number;
}

/** The segments that start in ten minutes, or those after one of them. */
export interface PastPage {
  readonly segments: readonly SegmentRef[];
  /** Whether there are more. */
  readonly more: boolean;
}

/** A UTC day as used in an address: 2026-11-22. */
export function dayOf(atMs: number): string {
  return new Date(atMs).toISOString().slice(0, 10);
}

/** A UTC minute as used in an address: 2026-11-22T14:20Z. */
export function minuteOf(atMs: number): string {
  return `${new Date(atMs).toISOString().slice(0, 16)}Z`;
}

/** The answer of `/past`; null if nothing may be seen. */
export function readSummary(json: unknown): PastSummary | null {
  const doc = new Doc(json, 'past');
  const pastMs = doc.count('past_ms');
  if (pastMs === 0 || doc.is('newest', null)) return null;
  const fromMs = doc.time('from_ms');
  const toMs = doc.time('to_ms', fromMs);
  const view = doc.text('view', VIEW);
  const daysMs = doc.list('days', DAYS_MAX, (day, where) =>
    new Doc({ day }, where).date('day', /^\d{4}-\d\d-\d\d$/, FIRST_MS, LAST_MS),
  );
  return { view, fromMs, toMs, pastMs, daysMs: [...new Set(daysMs)].sort((a, b) => b - a) };
}

/** What the answer of `/past` says about deletions; an older relay says nothing. */
export function readDeletions(json: unknown): PastDeletions {
  const doc = new Doc(json, 'past');
  if (doc.is('deleted', undefined)) return { view: '', spans: [] };
  const spans = doc.list('deleted', DELETED_MAX, (item, where) => {
    const span = new Doc(item, where);
    return { fromMs: span.time('from_ms', 0), toMs: span.time('to_ms', 0) };
  });
  return { view: doc.text('view', VIEW), spans };
}

/** The minutes of a day that starts at `dayMs`. */
export function readDay(json: unknown, dayMs: number): PastMinute[] {
  return new Doc(json, `day ${dayOf(dayMs)}`).list('minutes', MINUTES_MAX, (item, where) => {
    const doc = new Doc(item, where);
    const atMs = doc.date('minute', /^\d{4}-\d\d-\d\dT\d\d:\d\dZ$/, dayMs, dayMs + DAY_MS - 1);
    const [bytes, frames, faults] = [doc.count('bytes'), doc.count('frames'), doc.count('faults')];
    return { atMs, bytes, frames, word: doc.word(), faults };
  });
}

/** A part of the index of the ten minutes from `pageMs`. */
export function readPage(json: unknown, pageMs: number): PastPage {
  const doc = new Doc(json, `page ${minuteOf(pageMs)}`);
  const segments = doc.list('segments', SEGMENTS_MAX, (item, where) => readRef(item, where, pageMs));
  return { segments, more: doc.is('more', true) };
}

function readRef(json: unknown, where: string, pageMs: number): SegmentRef {
  const doc = new Doc(json, where);
  const fromMs = doc.time('from_ms', pageMs, pageMs + PAGE_MS - 1);
  const toMs = doc.time('to_ms', fromMs, fromMs + SEGMENT_MS_MAX);
  return {
    take: doc.text('take', /^[0-9a-f]{16}$/),
    index: doc.count('index', 2 ** 32),
    runId: doc.text('run', /^[0-9a-f]{16}$/),
    fromMs,
    toMs,
    frames: doc.count('frames'),
    bytes: doc.count('bytes'),
    sha256: doc.text('sha256', SHA256),
    schema: doc.is('schema', null) ? null : doc.text('schema', SHA256),
    model: doc.is('model', null) ? null : doc.text('model', SHA256),
    missing: doc.count('missing'),
    words: doc.list('words', SEGMENTS_MAX, (item, at) => {
      const word = new Doc(item, at);
      return { atMs: word.time('at_ms'), word: word.word() };
    }),
    events: doc.list('events', SEGMENTS_MAX, readEvent).filter((event) => event !== null),
  };
}

const SHA256 = /^[0-9a-f]{64}$/;

/** As in live: null if this page does not know it, because a newer relay may send more. */
function readEvent(json: unknown, where: string): (EventMessage & { readonly atMs: number }) | null {
  const atMs = new Doc(json, where).time('at_ms');
  const text = JSON.stringify(json);
  if (text.length > EVENT_CHARS_MAX) fail(where, `more than ${EVENT_CHARS_MAX} characters`);
  const event = parseRelayMessage(text);
  return event?.type === 'event' ? { ...event, atMs } : null;
}

/** `value` if it is a number from `least` to `most`. */
function within(value: unknown, where: string, least: number, most: number): number {
  if (typeof value === 'number' && value >= least && value <= most) return value;
  return fail(where, `no number from ${least} to ${most}`);
}

function fail(where: string, what: string): never {
  throw new PastError('damaged', `${where}: ${what}`);
}

/** An object in the relay's JSON, and its place there. */
class Doc {
  readonly #members: Readonly<Record<string, unknown>>;
  readonly #where: string;

  constructor(json: unknown, where: string) {
    if (typeof json !== 'object' || json === null) fail(where, 'no object');
    this.#members = json as Record<string, unknown>;
    this.#where = where;
  }

  is(name: string, value: boolean | null | undefined): boolean {
    return this.#members[name] === value;
  }

  count(name: string, most = COUNT_MAX): number {
    const value = within(this.#members[name], this.#at(name), 0, most);
    return Number.isInteger(value) ? value : fail(this.#at(name), 'no whole number');
  }

  /** Unix ms. */
  time(name: string, leastMs = FIRST_MS, mostMs = LAST_MS): number {
    return within(this.#members[name], this.#at(name), leastMs, mostMs);
  }

  text(name: string, form: RegExp): string {
    const value = this.#members[name];
    return typeof value === 'string' && form.test(value) ? value : fail(this.#at(name), 'not as documented');
  }

  /** Unix ms of a text. */
  date(name: string, form: RegExp, leastMs: number, mostMs: number): number {
    return within(Date.parse(this.text(name, form)), this.#at(name), leastMs, mostMs);
  }

  word(): RobotStatus {
    return WORDS.find((word) => word === this.#members.word) ?? fail(this.#at('word'), 'no word');
  }

  list<T>(name: string, most: number, read: (item: unknown, where: string) => T): T[] {
    const value = this.#members[name];
    if (!Array.isArray(value)) return fail(this.#at(name), 'no list');
    if (value.length > most) fail(this.#at(name), `${value.length} entries, ${most} allowed`);
    return value.map((item, i) => read(item, `${this.#at(name)}[${i}]`));
  }

  #at(name: string): string {
    return `${this.#where}: ${name}`;
  }
}
