import type { EventMessage, RobotStatus, Schema } from '@posecast/wire';
import type { Recorded } from '../twin/liveness.ts';

/**
 * What crosses between the past of a robot and the page. Moments are unix ms by the relay's clock, with fractions.
 */

/** How fast the past is played; 1: as it was. */
export const SPEEDS = [0.25, 0.5, 1, 2, 4] as const;
export type Speed = (typeof SPEEDS)[number];

/** A decoded frame of then. */
export interface PastState {
  readonly schemaId: number;
  readonly seq: number;
  /** Robot time, seconds. */
  readonly tS: number;
  readonly codes: Int32Array;
  /** When the relay accepted it. */
  readonly atMs: number;
  /** How late it was when the relay accepted it, ms. */
  readonly lateMs: number;
}

/** Who is told what was then, in the order in which the relay accepted it. */
export interface PastSink {
  /** What was shown before does not lead up to what comes. */
  jump(): void;
  schema(schema: Schema): void;
  model(sha256: string | null): void;
  info(kv: ReadonlyMap<string, string>): void;
  event(event: EventMessage): void;
  word(word: RobotStatus): void;
  state(state: PastState): void;
  /** What led up to the state that is shown, oldest first: the ten seconds before it as far as they are here. Told once the moment
   *  rests, and again when more of them have come. */
  lead(states: readonly PastState[]): void;
  /** The minute before the newest jump's moment, ten states a second at most, oldest first: for plots. */
  fill(schema: Schema, states: readonly PastState[]): void;
}

/**
 * Something that the person has to be told about what is shown. `loading`: it is on its way. `resumed`: its moment left
 * the window, so it goes on at the oldest. `not-kept`: the moment that a link names is not kept, and the nearest is shown.
 * `not-come`: it is still to come, and the present is shown. `unlooped`: somebody went out of the span that was repeated.
 * `damaged`: a part did not arrive as it was recorded, and was skipped. `away`: the relay, or the host of a recording, does
 * not answer, so only what the page has can be shown.
 */
export type PastNote = 'loading' | 'resumed' | 'not-kept' | 'not-come' | 'unlooped' | 'damaged' | 'away';

/** Where the page is in time. Every change makes a new object. */
export interface Playhead {
  readonly at: 'live' | 'past';
  /** The moment that is shown; in `live` the newest that is known. */
  readonly momentMs: number;
  readonly playing: boolean;
  readonly speed: Speed;
  /** The span that is played again and again. */
  readonly loop: Span | null;
  readonly note: PastNote | null;
  /** The moment that a link named, until somebody goes elsewhere. */
  readonly askedMs: number | null;
  /** The recording that is played; null where it is a past that leads up to the present. */
  readonly recorded: Recorded | null;
}

export interface Span {
  readonly fromMs: number;
  readonly toMs: number;
}

/** Something that began at a moment. */
export interface Mark {
  readonly atMs: number;
  readonly level: 'fault' | 'caution';
  readonly source: string;
  readonly text: string;
  /** Whether the moment is exact; else it is that of a minute in which as much is known to have begun. */
  readonly exact: boolean;
  /** How many began in that minute; 1 unless said. */
  readonly count?: number;
}

/** What a time line draws, oldest first. Every change makes a new object. */
export interface Timeline extends Span {
  /** How much moved. Between the spans nothing was recorded. */
  readonly movement: readonly (Span & { readonly bytesPerS: number })[];
  /** When the robot was STALE (`silent`) or OFFLINE. */
  readonly words: readonly (Span & { readonly word: 'silent' | 'offline' })[];
  readonly marks: readonly Mark[];
  /** Days of which something was recorded, and what is not known yet; none unless said. Nothing else lies in them. */
  readonly unknown?: readonly Span[];
}

/** An event and when the relay had it. */
export type PastEvent = EventMessage & { readonly atMs: number };

/** What somebody can do with a robot's past. */
export interface PastControls {
  readonly playhead: Playhead;
  /** null while nothing is known, and where there is no past that this page may see. */
  readonly timeline: Timeline | null;
  /** The moment of now; of a recording its end. */
  readonly nowMs: number;
  /** How far what comes live lies behind that, ms. */
  readonly behindMs: number;
  /** The events that the live stream has told, oldest first, as far as they are remembered. Every change makes a new array. */
  readonly heard: readonly EventMessage[];
  /** Adds a listener for `playhead` and `timeline`, which is called ten times a second at most while playing. Returns a
   *  function that removes it. */
  readonly onChange: (listener: () => void) => () => void;
  /** Somebody looks at the time line, so what a drag needs is fetched. */
  attend(): void;
  /** The time line shows a span: what is not known of its days is fetched, and a drag across hours needs less of each minute. */
  look(span: Span): void;
  /** Shows a moment that somebody named, and rests there; if it is not kept, or nothing was recorded then, the nearest that is;
   *  if it is still to come, the present. Either is told. */
  openAt(momentMs: number): void;
  /** Fetches what was recorded on the day (UTC) of a moment, by minutes. Resolves to whether that is known. */
  loadDay(momentMs: number): Promise<boolean>;
  /** The known events of a span, oldest first, each once. */
  eventsIn(span: Span): readonly PastEvent[];
  /** Fetches the events of the ten minutes in which a moment lies. Resolves to whether they are here. */
  loadEvents(momentMs: number): Promise<boolean>;
  /** Shows a moment. From live it plays on from there; in the past it plays or rests as before. `scrubbing`: a finger is
   *  down, and a pose of the same seconds is near enough until `settle`. */
  seek(momentMs: number, scrubbing?: boolean): void;
  /** The finger is up: shows the exact moment of the last `seek`. */
  settle(): void;
  /** Plays or pauses. In live it pauses at the newest moment; at the end of a recording it plays from the beginning. */
  toggle(): void;
  setSpeed(speed: Speed): void;
  skip(byMs: number): void;
  /** Shows the next or the previous frame, and pauses. */
  step(by: 1 | -1): void;
  setLoop(span: Span | null): void;
  /** Goes to two seconds before the next or the previous fault. */
  visitFault(by: 1 | -1): void;
  /** Goes back to the present; in a recording, which has none, to its end. */
  goLive(): void;
}
