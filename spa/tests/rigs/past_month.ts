import { createHash } from 'node:crypto';
import {
  type EventMessage,
  encodeKeyPage,
  encodeSegment,
  type Segment,
  type SegmentRecord,
} from '@posecast/wire';

const MINUTE_MS = 60_000;
const PAGE_MS = 600_000;
const DAY_MS = 86_400_000;
const SEGMENT_MS = 4000;

/** A relay's answer. */
export interface Told {
  readonly body: string | Uint8Array<ArrayBuffer>;
  readonly type: 'application/json' | 'application/octet-stream';
}

export interface MonthOptions {
  readonly toMs: number;
  readonly days?: number;
  readonly schemaText: string;
  /** Whether anything was recorded in a minute; by default always. */
  readonly isRecorded?: (atMs: number) => boolean;
  /** How many faults start in a minute, a few seconds apart. */
  readonly faults?: (atMs: number) => number;
}

/**
 * The answers of a relay that has kept everything about a robot for a month, in segments of four seconds: the given ones,
 * repeated as if recorded at that time. Everything is created on demand.
 */
export class Month {
  readonly #given: readonly Segment[];
  readonly #options: Required<MonthOptions>;
  readonly fromMs: number;

  constructor(given: readonly Segment[], options: MonthOptions) {
    this.#given = given;
    this.#options = { days: 31, isRecorded: () => true, faults: () => 0, ...options };
    const { toMs, days } = this.#options;
    this.fromMs = toMs - days * DAY_MS;
    this.fromMs -= this.fromMs % SEGMENT_MS;
  }

  /** The answer for a path below `…/past`; null if the relay would answer 404. */
  answer(path: string): Told | null {
    const [where = '', query = ''] = path.split('?');
    if (where === '') return json(this.#summary());
    const parts = where.slice(1).split('/');
    const [, first = '', second] = parts;
    if (first === 'schema') return { body: this.#options.schemaText, type: 'application/octet-stream' };
    if (/^[0-9a-f]{16}$/.test(first)) {
      const segment = this.#segment(Number.parseInt(first, 16) * DAY_MS + Number(second) * SEGMENT_MS);
      return { body: new Uint8Array(encodeSegment(segment)), type: 'application/octet-stream' };
    }
    const atMs = Date.parse(first);
    if (/^\d{4}-\d\d-\d\d$/.test(first)) return json(this.#day(atMs));
    if (second === 'keys') return this.#keys(atMs, Number(new URLSearchParams(query).get('every') ?? 1));
    return json(this.#page(atMs, new URLSearchParams(query).get('after')));
  }

  #summary() {
    const { toMs } = this.#options;
    const days = [];
    for (let day = Math.floor(this.fromMs / DAY_MS); day * DAY_MS <= toMs; day += 1)
      if (this.#minutes(day * DAY_MS).length > 0)
        days.push(new Date(day * DAY_MS).toISOString().slice(0, 10));
    const newest = { take: takeOf(toMs), index: Math.floor((toMs % DAY_MS) / SEGMENT_MS) };
    return {
      ...{ view: 'public', from_ms: this.fromMs, to_ms: toMs, past_ms: 31 * DAY_MS, delay_ms: 0 },
      ...{ newest, days },
    };
  }

  #minutes(dayMs: number): number[] {
    const found = [];
    for (let atMs = dayMs; atMs < dayMs + DAY_MS; atMs += MINUTE_MS) if (this.#isKept(atMs)) found.push(atMs);
    return found;
  }

  #isKept(atMs: number): boolean {
    const minuteMs = atMs - (atMs % MINUTE_MS);
    return atMs >= this.fromMs && atMs < this.#options.toMs && this.#options.isRecorded(minuteMs);
  }

  #day(dayMs: number) {
    const minutes = this.#minutes(dayMs).map((atMs) => ({
      minute: `${new Date(atMs).toISOString().slice(0, 16)}Z`,
      ...{
        bytes: Math.round(60_000 * (1.5 + Math.sin(atMs / 4e6) + Math.sin(atMs / 9e5) / 3)),
        frames: 1800,
      },
      ...{ word: 'online', faults: this.#options.faults(atMs) },
    }));
    return { view: 'public', day: new Date(dayMs).toISOString().slice(0, 10), minutes };
  }

  #startsOf(pageMs: number): number[] {
    const found = [];
    const first = Math.ceil(pageMs / SEGMENT_MS) * SEGMENT_MS;
    for (let atMs = first; atMs < pageMs + PAGE_MS; atMs += SEGMENT_MS)
      if (this.#isKept(atMs)) found.push(atMs);
    return found;
  }

  #page(pageMs: number, after: string | null) {
    const segments = this.#startsOf(pageMs).map((atMs) => {
      const segment = this.#segment(atMs);
      const bytes = encodeSegment(segment);
      const { take, index, runId, fromMs, schema, model } = segment.start;
      return {
        ...{ take, index, run: runId, from_ms: fromMs, to_ms: segment.toMs, frames: 120 },
        ...{ first_seq: index * 120, last_seq: index * 120 + 119, bytes: bytes.length },
        ...{ sha256: createHash('sha256').update(bytes).digest('hex'), schema, model, missing: 0 },
        ...{ words: [{ at_ms: fromMs, word: 'online' }], events: this.#eventsAt(atMs) },
      };
    });
    const place = segments.findIndex(({ take, index }) => `${take},${index}` === after);
    const from = `${new Date(pageMs).toISOString().slice(0, 16)}Z`;
    return { view: 'public', from, more: false, segments: segments.slice(place + 1) };
  }

  /** The n-th fault of a minute begins in its n-th segment and is over in the next. */
  #eventsAt(atMs: number) {
    const minuteMs = atMs - (atMs % MINUTE_MS);
    const first = Math.ceil(minuteMs / SEGMENT_MS) * SEGMENT_MS;
    const nth = (atMs - first) / SEGMENT_MS;
    const count = this.#options.faults(minuteMs);
    const event = (nthNow: number, eventMs: number, state: EventMessage['state']) => ({
      ...{ at_ms: eventMs, type: 'event', n: 2 * (minuteMs / MINUTE_MS) + nthNow, t: 1 },
      ...{ at: eventMs / 1000, level: 'fault', source: 'RKN', text: 'bigError', state },
    });
    const begins = nth < count ? [event(nth, atMs + 1000, 'on')] : [];
    const ends = nth >= 1 && nth <= count ? [event(nth, atMs + 500, 'off')] : [];
    return [...ends, ...begins];
  }

  #keys(pageMs: number, every: number): Told {
    const all = this.#startsOf(pageMs).filter((_, i) => i % every === 0);
    const robot = { robot: 'r', view: 'public', fromMs: pageMs };
    const page = encodeKeyPage(
      robot,
      all.map((atMs) => this.#segment(atMs)),
    );
    return { body: new Uint8Array(page), type: 'application/octet-stream' };
  }

  #segment(atMs: number): Segment {
    const place = Math.floor((atMs % DAY_MS) / SEGMENT_MS);
    const given = this.#given[place % this.#given.length]!;
    const take = takeOf(atMs);
    const start = { ...given.start, fromMs: atMs, take, runId: take, index: place, openFaults: [] };
    const events: SegmentRecord[] = this.#eventsAt(atMs).map(({ at_ms, ...event }) => ({
      ...{ kind: 'event', atUs: 1000 * (at_ms - atMs), text: JSON.stringify(event) },
    }));
    const records = [...given.records, ...events]
      .filter(({ atUs }) => atUs < 1000 * SEGMENT_MS)
      .sort((a, b) => a.atUs - b.atUs);
    return { start, toMs: atMs + SEGMENT_MS - 1, records };
  }

  /** A store's content for a span: segments and their names, as in `archive/names.py` of the relay. */
  *files({ fromMs, toMs }: { fromMs: number; toMs: number }): Generator<[name: string, bytes: Uint8Array]> {
    for (let atMs = Math.ceil(fromMs / SEGMENT_MS) * SEGMENT_MS; atMs < toMs; atMs += SEGMENT_MS) {
      const segment = this.#segment(atMs);
      const bytes = encodeSegment(segment);
      const { robot, view, take, index } = segment.start;
      const [day, clock] = new Date(atMs).toISOString().split('T');
      const page = `${clock!.slice(0, 2)}-${clock![3]}0`;
      const file = `${atMs}-${segment.toMs}-${take}-${index}-${bytes.length}-a.segment`;
      yield [`${robot}/${view}/${day}/${page}/${file}`, bytes];
    }
  }
}

/** One take per day. */
function takeOf(atMs: number): string {
  return Math.floor(atMs / DAY_MS)
    .toString(16)
    .padStart(16, '0');
}

function json(value: unknown): Told {
  return { body: JSON.stringify(value), type: 'application/json' };
}
