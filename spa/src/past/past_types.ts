import type { EventMessage, RobotStatus, Schema } from '@posecast/wire';
import type { Span } from '../kit.ts';
import type { Recorded } from '../twin/liveness.ts';

/** The interface between a robot's past and the page. Moments are unix ms by the relay's clock, with fractions. */

/** Playback speed; 1: real time. */
export const SPEEDS = [0.25, 0.5, 1, 2, 4] as const;
export type Speed = (typeof SPEEDS)[number];

/** A decoded frame from the past. */
export interface PastState {
  readonly schemaId: number;
  readonly seq: number;
  /** Robot time, seconds. */
  readonly tS: number;
  readonly codes: Int32Array;
  /** When the relay accepted it. */
  readonly atMs: number;
  /** Its delay when the relay accepted it, ms. */
  readonly lateMs: number;
}

/** Receives the past, in the order in which the relay accepted it. */
export interface PastSink {
  /** What was shown before does not lead up to what follows. */
  jump(): void;
  schema(schema: Schema): void;
  model(sha256: string | null): void;
  info(kv: ReadonlyMap<string, string>): void;
  event(event: EventMessage): void;
  word(word: RobotStatus): void;
  state(state: PastState): void;
  /** The states that led up to the shown one, oldest first: up to ten seconds before it, as far as loaded. Sent once the moment
   *  rests, and again when more of them have loaded. */
  lead(states: readonly PastState[]): void;
  /** The minute before the target of the newest jump, at most ten states a second, oldest first: for plots. */
  fill(schema: Schema, states: readonly PastState[]): void;
}

/**
 * A message to the viewer about what is shown. `loading`: data is on its way. `resumed`: the shown moment is no longer kept, so
 * playback continues at the oldest one. `not-kept`: the moment in the link is not kept, and the nearest is shown. `not-come`: the
 * moment is in the future, and the present is shown. `unlooped`: the viewer left the repeated span. `damaged`: a part was corrupt
 * and was skipped. `away`: the relay, or the host of a recording, does not answer, so only loaded data can be shown.
 */
export type PastNote = 'loading' | 'resumed' | 'not-kept' | 'not-come' | 'unlooped' | 'damaged' | 'away';

/** The playback position. Every change makes a new object. */
export interface Playhead {
  readonly at: 'live' | 'past';
  /** The shown moment; in `live`, the newest known one. */
  readonly momentMs: number;
  readonly playing: boolean;
  readonly speed: Speed;
  /** The span that is repeated. */
  readonly loop: Span | null;
  readonly note: PastNote | null;
  /** The moment in the link, until the viewer moves elsewhere. */
  readonly askedMs: number | null;
  /** The recording being played; null for a past that leads up to the present. */
  readonly recorded: Recorded | null;
}

export type { Span } from '../kit.ts';

export const MINUTE_MS = 60_000;
/** Length of a page of the index or of first poses, ms. */
export const PAGE_MS = 10 * MINUTE_MS;
export const DAY_MS = 144 * PAGE_MS;

/** Something that started at a moment. */
export interface Mark {
  readonly atMs: number;
  readonly level: 'fault' | 'caution';
  readonly source: string;
  readonly text: string;
  /** Whether the moment is exact; otherwise it is a minute in which at least one is known to have started. */
  readonly exact: boolean;
  /** How many started in that minute; 1 by default. */
  readonly count?: number;
}

/** The data of a time line, oldest first. Every change makes a new object. */
export interface Timeline extends Span {
  /** The amount of movement. Nothing was recorded between the spans. */
  readonly movement: readonly (Span & { readonly bytesPerS: number })[];
  /** When the robot was STALE (`silent`) or OFFLINE. */
  readonly words: readonly (Span & { readonly word: 'silent' | 'offline' })[];
  readonly marks: readonly Mark[];
  /** Days with recorded data, and days not known yet; none by default. All other days are empty. */
  readonly unknown?: readonly Span[];
}

/** An event and the time when the relay received it. */
export type PastEvent = EventMessage & { readonly atMs: number };

/** The operations on a robot's past. */
export interface PastControls {
  readonly playhead: Playhead;
  /** null while nothing is known, and if there is no past that this page may see. */
  readonly timeline: Timeline | null;
  /** The current time; for a recording, its end. */
  readonly nowMs: number;
  /** The delay of live data, ms. */
  readonly behindMs: number;
  /** The events received over the live stream, oldest first, as far as they are kept. Every change makes a new array. */
  readonly heard: readonly EventMessage[];
  /** Adds a listener for `playhead` and `timeline`, called at most ten times a second while playing. Returns a function that
   *  removes it. */
  readonly onChange: (listener: () => void) => () => void;
  /** The viewer looks at the time line, so prefetch what dragging needs. */
  attend(): void;
  /** The time line shows this span: unknown days in it are fetched, and a drag across hours needs less of each minute. */
  look(span: Span): void;
  /** Shows a requested moment, paused. If it is not kept or nothing was recorded then, shows the nearest one; if it is in the
   *  future, the present. A note tells the viewer either way. */
  openAt(momentMs: number): void;
  /** Fetches the per-minute data of the day (UTC) of a moment. Resolves to whether it is known. */
  loadDay(momentMs: number): Promise<boolean>;
  /** The known events in a span, oldest first, each once. */
  eventsIn(span: Span): readonly PastEvent[];
  /** Fetches the events in the ten minutes around a moment. Resolves to whether they are loaded. */
  loadEvents(momentMs: number): Promise<boolean>;
  /** Shows a moment. From live it continues playing; in the past it stays playing or paused. `scrubbing`: a finger is down, and a
   *  pose within a few seconds is good enough until `settle`. */
  seek(momentMs: number, scrubbing?: boolean): void;
  /** The finger was lifted: shows the exact moment of the last `seek`. */
  settle(): void;
  /** Plays or pauses. In live it pauses at the newest moment; at the end of a recording it plays from the start. */
  toggle(): void;
  setSpeed(speed: Speed): void;
  skip(byMs: number): void;
  /** Shows the next or previous frame, and pauses. */
  step(by: 1 | -1): void;
  setLoop(span: Span | null): void;
  /** Goes to two seconds before the next or previous fault. */
  visitFault(by: 1 | -1): void;
  /** Returns to the present; in a recording, which has none, to its end. */
  goLive(): void;
}
