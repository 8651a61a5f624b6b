import type { EventMessage, RobotStatus, Schema } from '@posecast/wire';
import type { PastSink, PastState } from '../../past_types.ts';

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
    if (this.#events.size > TOLD_EVENTS_MAX) this.#events.delete(this.#events.values().next().value!);
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

function causeOf({ source, text }: EventMessage): string {
  return `${source}\n${text}`;
}

function byCause(faults: readonly EventMessage[]): Map<string, EventMessage> {
  return new Map(faults.map((event) => [causeOf(event), event]));
}
