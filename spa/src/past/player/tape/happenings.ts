import type { EventMessage, RobotStatus, Schema } from '@posecast/wire';
import { dropOldest } from '../../../kit.ts';
import { causeOf } from '../../../twin/names.ts';
import type { PastSource } from '../../past_source.ts';
import {
  MINUTE_MS,
  PAGE_MS,
  type PastEvent,
  type PastSink,
  type PastState,
  type Span,
} from '../../past_types.ts';

/** Maximum number of events remembered as sent. */
const TOLD_EVENTS_MAX = 500;

/** The state at a moment, other than the pose. */
export interface Situation {
  readonly model: string | null;
  readonly info: ReadonlyMap<string, string>;
  readonly word: RobotStatus | null;
  /** Events that are active, oldest first. */
  readonly faults: readonly EventMessage[];
}

/** A change of the situation. */
export type Change =
  | { readonly kind: 'event'; readonly event: EventMessage }
  | { readonly kind: 'info'; readonly info: ReadonlyMap<string, string> }
  | { readonly kind: 'model'; readonly model: string | null }
  | { readonly kind: 'word'; readonly word: RobotStatus }
  /** The start of a segment, with the situation stored there. */
  | { readonly kind: 'start'; readonly start: Situation };

/** A change at a moment (unix ms). `place`: how many frames of its segment come before it. */
export type Happening = Change & { readonly atMs: number; readonly place: number };

/** The situation after applying changes in order. */
export function situationAfter(before: Situation, changes: Iterable<Change>): Situation {
  let { model, info, word } = before;
  let faults = byCause(before.faults);
  for (const change of changes) {
    if (change.kind === 'event') {
      const { event } = change;
      faults.delete(causeOf(event));
      if (event.state === 'on') faults.set(causeOf(event), event);
    } else if (change.kind === 'info') info = change.info;
    else if (change.kind === 'model') model = change.model;
    else if (change.kind === 'word') word = change.word;
    else {
      ({ model, info, word } = change.start);
      faults = byCause(change.start.faults);
    }
  }
  return { model, info, word, faults: [...faults.values()] };
}

/** Sends a sink what is new since the newest jump. */
export class Teller {
  #schemaId: number | null = null;
  #model: string | null | undefined;
  #info: ReadonlyMap<string, string> | null = null;
  #word: RobotStatus | null = null;
  #events = new Set<string>();

  constructor(readonly sink: PastSink) {}

  jump(): void {
    this.#schemaId = null;
    this.#model = undefined;
    this.#info = null;
    this.#word = null;
    this.#events = new Set();
    this.sink.jump();
  }

  schema(schema: Schema): void {
    if (schema.id === this.#schemaId) return;
    this.#schemaId = schema.id;
    this.sink.schema(schema);
  }

  state(schema: Schema, state: PastState): void {
    this.schema(schema);
    this.sink.state(state);
  }

  model(model: string | null): void {
    if (model === this.#model) return;
    this.#model = model;
    this.sink.model(model);
  }

  word(word: RobotStatus | null): void {
    if (word === null || word === this.#word) return;
    this.#word = word;
    this.sink.word(word);
  }

  /** Each event once, however often it is given, in the order of occurrence. */
  events(events: readonly EventMessage[]): void {
    for (const event of inOrder(events)) this.#tellEvent(event);
  }

  situation({ model, info, word, faults }: Situation): void {
    this.model(model);
    this.#tellInfo(info);
    this.events(faults);
    this.word(word);
  }

  change(change: Change): void {
    if (change.kind === 'event') this.#tellEvent(change.event);
    else if (change.kind === 'info') this.#tellInfo(change.info);
    else if (change.kind === 'model') this.model(change.model);
    else if (change.kind === 'word') this.word(change.word);
    else this.situation(change.start);
  }

  #tellInfo(info: ReadonlyMap<string, string>): void {
    const told = this.#info;
    if (told?.size === info.size && [...info].every(([name, text]) => told.get(name) === text)) return;
    this.#info = info;
    this.sink.info(info);
  }

  /** Overlapping takes and the page itself report the same events; a robot's relay gives each a unique number and date. */
  #tellEvent(event: EventMessage): void {
    const name = nameOf(event);
    if (this.#events.has(name)) return;
    this.#events.add(name);
    dropOldest(this.#events, TOLD_EVENTS_MAX);
    this.sink.event(event);
  }
}

/** Identifies an event, however often it is received. */
export function nameOf({ n, at, t }: EventMessage): string {
  return `${n} ${at ?? t}`;
}

/** Events in order of occurrence; those without a date first. */
export function inOrder(events: readonly EventMessage[]): EventMessage[] {
  return events.toSorted((a, b) => (a.at ?? 0) - (b.at ?? 0) || a.n - b.n);
}

function byCause(faults: readonly EventMessage[]): Map<string, EventMessage> {
  return new Map(faults.map((event) => [causeOf(event), event]));
}

/** How far back recent events go, ms. */
const RECENT_MS = 600_000;
const EVENTS_MAX = 100;

/** The known events in a span, oldest first, without the duplicates of overlapping takes. `heard`: events from the live stream;
 *  its newest are in no segment yet. */
export function listEvents(
  source: PastSource,
  heard: readonly EventMessage[],
  { fromMs, toMs }: Span,
): readonly PastEvent[] {
  const told = heard.flatMap((event) => (event.at === null ? [] : [{ ...event, atMs: 1000 * event.at }]));
  const recorded = source.segmentsIn({ fromMs, toMs }).flatMap((ref) => ref.events);
  const within = [...told, ...recorded].filter(({ atMs }) => atMs >= fromMs && atMs <= toMs);
  const once = new Map(within.map((event) => [nameOf(event), event]));
  return [...once.values()].sort((a, b) => a.atMs - b.atMs);
}

/** The number of the page before a moment's own, if it must be fetched to know the recent faults at that moment; null if the
 *  marks of the time line show none there. */
export function pageBefore({ timeline }: PastSource, momentMs: number): number | null {
  const sinceMs = momentMs - RECENT_MS;
  const endMs = momentMs - (momentMs % PAGE_MS);
  if (timeline === null || endMs <= timeline.fromMs) return null;
  const isUnknown =
    timeline.unknown?.some(({ fromMs, toMs }) => fromMs < endMs && toMs > sinceMs) ||
    timeline.marks.some(({ atMs, exact }) => !exact && atMs < endMs && atMs > sinceMs - MINUTE_MS);
  return isUnknown === true ? Math.floor(sinceMs / PAGE_MS) : null;
}

/** The newest known events before a moment, oldest first: what a viewer who joined then would have received. `heard`: events from
 *  the live stream. */
export function listRecentEvents(
  source: PastSource,
  heard: readonly EventMessage[],
  momentMs: number,
): readonly EventMessage[] {
  const fromMs = momentMs - RECENT_MS;
  const recorded = source.segmentsIn({ fromMs, toMs: momentMs }).flatMap(({ events }) => events);
  const recent = [...recorded, ...heard].filter(
    ({ at }) => at !== null && at * 1000 > fromMs && at * 1000 <= momentMs,
  );
  const events = new Map(recent.map((event) => [nameOf(event), event]));
  return inOrder([...events.values()]).slice(-EVENTS_MAX);
}
