import type { EventMessage } from '@posecast/wire';
import { Emitter } from '../../kit.ts';
import type { Recorded } from '../../twin/liveness.ts';
import type { PastSource } from '../past_source.ts';
import type { PastNote, PastSink, Playhead, Span, Speed, Timeline } from '../past_types.ts';
import type { OwnTape } from './tape/own_tape.ts';
import { LOADS_MAX, PATIENCE_MS, type Pending } from './tape/reel.ts';

/** Maximum age of the newest known moment while a robot is on air; if it is older, the relay's clock is unknown, ms. */
const RECENT_MS = 15_000;

/** The relay's clock minus the page's, ms, derived from the newest known moment; with `beforeMs`, the previous result. The newest
 *  moment is a lower bound for the relay's time. While nothing new is known, the clocks are assumed to agree. */
export function relayAhead(
  beforeMs: number,
  timeline: Pick<Timeline, 'toMs'>,
  playhead: Pick<Playhead, 'at' | 'momentMs'>,
  pageMs: number,
): number {
  const newestMs = playhead.at === 'live' ? Math.max(timeline.toMs, playhead.momentMs) : timeline.toMs;
  const aheadMs = Math.max(beforeMs, newestMs - pageMs);
  return aheadMs < -RECENT_MS ? Math.max(beforeMs, 0) : aheadMs;
}

/** The longest step that the page's clock counts between two ticks, ms: a page that was hidden or busy continues from where it
 *  was. */
export const LOOK_MS_MAX = 1000;

/** The shown moment of the past, as the page's clock advances. Pure: the clock is passed in. */
export class PlayheadClock {
  #momentMs = 0;
  #lookedMs = 0;
  speed: Speed = 1;
  /** The moment moves only while it runs. */
  running = false;

  get momentMs(): number {
    return this.#momentMs;
  }

  /** Where the playhead is by now if nothing stops it. */
  target(nowMs: number): number {
    if (!this.running) return this.#momentMs;
    return this.#momentMs + Math.min(LOOK_MS_MAX, Math.max(0, nowMs - this.#lookedMs)) * this.speed;
  }

  /** Continues from its position. */
  run(nowMs: number): void {
    this.running = true;
    this.#lookedMs = nowMs;
  }

  /** Moves the playhead to a moment, where it continues. */
  set(momentMs: number, nowMs: number): void {
    this.#momentMs = momentMs;
    this.#lookedMs = nowMs;
  }
}

/** Minimum time between two calls of the listeners while only the moment advances, ms. */
const CHANGE_EVERY_MS = 100;
/** Changes that the listeners hear about at once. */
const TOLD_AT_ONCE = ['at', 'playing', 'speed', 'loop', 'note'] as const;

export interface PastPorts {
  readonly source: PastSource;
  /** What the page itself has received. */
  readonly own: OwnTape;
  readonly sink: PastSink;
  /** The events kept from the live stream. */
  readonly heard: () => readonly EventMessage[];
  /** The page's clock, which never steps back. */
  readonly nowMs: () => number;
  /** Calls a function after some ms. Returns a function that cancels it. */
  readonly schedule: (run: () => void, afterMs: number) => () => void;
  /** Called when the player rests no longer. */
  readonly wake?: () => void;
  /** The recording being played, at whose end the player pauses; null or omitted if the past leads up to the present. */
  readonly recorded?: Recorded | null;
}

/** The position of a player in time, and its target. Notifies listeners of changes. */
export class PlayheadState {
  readonly clock = new PlayheadClock();
  readonly recorded: Recorded | null;
  isPast: boolean;
  loop: Span | null = null;
  /** Set while a finger drags. `isNewest`: it is at the newest end of the time line. */
  scrubbing: { isNewest: boolean } | null = null;
  /** The moment to go to, until its exact state is shown. */
  wantedMs: number | null = null;
  /** The moment in the link, until the viewer moves elsewhere. */
  askedMs: number | null = null;
  /** How many frames are left to step; negative: backwards. */
  steps = 0;
  /** When something was last shown, by the page's clock. */
  shownMs = 0;
  /** Counts the requested moments; data fetched for an earlier one is obsolete. */
  wants = 0;
  /** Counts the viewer's actions; a search started by an earlier action is obsolete. */
  acts = 0;
  /** The newest visit to a fault: its target, its time by the page's clock, and the number of the action. */
  visited = { goesMs: 0, atMs: Number.NEGATIVE_INFINITY, act: 0 };
  readonly #ports: PastPorts;
  readonly #notes = new PastNotes();
  readonly #changed = new Emitter();
  /** The relay's clock minus the page's. */
  #aheadMs = Number.NEGATIVE_INFINITY;
  #playhead: Playhead;
  #changedMs = 0;

  constructor(ports: PastPorts) {
    const { recorded = null, nowMs } = ports;
    this.#ports = ports;
    this.recorded = recorded;
    this.isPast = recorded !== null;
    if (recorded !== null) this.clock.set(recorded.fromMs, nowMs());
    this.#playhead = this.#read();
  }

  /** The state last sent to the listeners. */
  get playhead(): Playhead {
    return this.#playhead;
  }

  get timeline(): Timeline | null {
    return this.#ports.source.timeline;
  }

  /** The present by the relay's clock; for a recording, its end. */
  get nowMs(): number {
    if (this.recorded !== null) return this.recorded.toMs;
    const pageMs = this.#ports.nowMs();
    const toMs = this.timeline?.toMs ?? Number.NEGATIVE_INFINITY;
    this.#aheadMs = relayAhead(this.#aheadMs, { toMs }, this.#playhead, pageMs);
    return pageMs + this.#aheadMs;
  }

  get oldestMs(): number {
    return this.timeline?.fromMs ?? Number.NEGATIVE_INFINITY;
  }

  /** The newest known moment. */
  get newestMs(): number {
    const { own, nowMs } = this.#ports;
    const recordedMs = this.timeline?.toMs ?? Number.NEGATIVE_INFINITY;
    if (!this.isPast && this.timeline !== null) own.guess(recordedMs);
    const newestMs = Math.max(recordedMs, own.newest?.atMs ?? Number.NEGATIVE_INFINITY);
    return Number.isFinite(newestMs) ? newestMs : nowMs();
  }

  /** The shown moment; in the present, the newest one. */
  get hereMs(): number {
    return this.isPast ? this.clock.momentMs : this.newestMs;
  }

  /** Whether a recording is at its end. */
  get hasEnded(): boolean {
    return this.recorded !== null && this.clock.momentMs >= this.recorded.toMs;
  }

  /** The nearest moment that is still kept. */
  keptMs(momentMs: number): number {
    return Math.max(Math.min(momentMs, this.newestMs), this.oldestMs);
  }

  /** The viewer did something: earlier notes no longer apply. */
  act(): void {
    this.acts += 1;
    this.#notes.forget();
    this.askedMs = null;
  }

  /** Ends the loop, with a note, if a moment lies outside it. */
  leaveLoop(momentMs: number): void {
    if (this.loop === null || (momentMs >= this.loop.fromMs && momentMs <= this.loop.toMs)) return;
    this.loop = null;
    this.say('unlooped');
  }

  /** Leaves the present for the past, which plays from there. */
  enter(): void {
    if (this.isPast) return;
    this.isPast = true;
    this.clock.run(this.#ports.nowMs());
    this.#ports.source.follow('near');
  }

  /** Goes back to the present. */
  leave(): void {
    this.wantedMs = null;
    this.isPast = false;
    this.loop = null;
    this.scrubbing = null;
    this.clock.running = false;
    this.clock.speed = 1;
  }

  /** Moves the playhead to a moment, from which it continues now. */
  move(momentMs: number): void {
    this.clock.set(momentMs, this.#ports.nowMs());
  }

  /** Stops playing. */
  rest(): void {
    this.clock.running = false;
    this.#notes.rest();
  }

  /** Moves the playhead to a moment that is still to be shown. */
  want(momentMs: number): void {
    this.#show(momentMs);
    this.wantedMs = momentMs;
    this.wants += 1;
    this.steps = 0;
  }

  /** The requested state is now shown, and is of this moment. */
  arrive(momentMs: number): void {
    this.#show(momentMs);
    this.wantedMs = null;
    this.#changedMs = Number.NEGATIVE_INFINITY; // published at once
  }

  say(note: PastNote): void {
    this.#notes.say(note, this.#ports.nowMs());
  }

  /** Waits for data that is being fetched. */
  wait(pending: readonly Pending[]): void {
    this.#notes.wait(pending, this.#ports.nowMs());
  }

  /** Fetches what is pending and waits for it. If nothing is pending, stops waiting. */
  fetchAndWait(pending: readonly Pending[]): void {
    for (const each of pending.slice(0, LOADS_MAX)) each.begin();
    if (pending.length === 0) this.#notes.rest();
    else this.wait(pending);
  }

  readonly onChange = this.#changed.on;

  /** Calls the listeners if something has changed, or if `always`; while only the moment advances, every `CHANGE_EVERY_MS`. */
  publish(always = false): void {
    const [before, now] = [this.#playhead, this.#read()];
    const nowMs = this.#ports.nowMs();
    if (!always && TOLD_AT_ONCE.every((name) => before[name] === now[name])) {
      const goesOn = now.playing && this.scrubbing === null && this.wantedMs === null;
      if (before.momentMs === now.momentMs || (goesOn && nowMs - this.#changedMs < CHANGE_EVERY_MS)) return;
    }
    this.#changedMs = nowMs;
    this.#playhead = now;
    this.#changed.emit();
  }

  close(): void {
    this.isPast = false;
    this.#changed.clear();
  }

  #show(momentMs: number): void {
    this.move(momentMs);
    this.shownMs = this.#ports.nowMs();
    this.#notes.rest();
  }

  #read(): Playhead {
    const { momentMs, running: playing, speed } = this.clock;
    const said = {
      note: this.#notes.read(this.#ports.nowMs()),
      askedMs: this.askedMs,
      recorded: this.recorded,
    };
    if (!this.isPast)
      return { at: 'live', momentMs: this.newestMs, playing: true, speed: 1, loop: null, ...said };
    return { at: 'past', momentMs, playing, speed, loop: this.loop, ...said };
  }
}

/** How long a note is shown if nothing else ends it, ms. */
const NOTE_MS = 5000;
/** How long a note about a link is shown, ms: long enough to read it twice while the page opens. */
export const LINK_NOTE_MS = 15_000;

/** Which note the viewer sees; times are by the page's clock. */
export class PastNotes {
  #said: { note: PastNote; sinceMs: number } | null = null;
  /** Since when data is awaited. */
  #waitingMs: number | null = null;
  #isAway = false;

  say(note: PastNote, nowMs: number): void {
    this.#said = { note, sinceMs: nowMs };
  }

  /** The message no longer applies. */
  forget(): void {
    this.#said = null;
  }

  /** These are being awaited. */
  wait(pending: readonly Pending[], nowMs: number): void {
    this.#waitingMs ??= nowMs;
    this.#isAway = pending.some(({ state }) => state === 'away');
  }

  /** Nothing is awaited any more. */
  rest(): void {
    this.#waitingMs = null;
    this.#isAway = false;
  }

  read(nowMs: number): PastNote | null {
    if (this.#isAway) return 'away';
    if (this.#waitingMs !== null && nowMs - this.#waitingMs > PATIENCE_MS) return 'loading';
    const said = this.#said;
    if (said !== null && said.note !== 'not-kept') {
      const staysMs = said.note === 'not-come' ? LINK_NOTE_MS : NOTE_MS;
      if (nowMs - said.sinceMs >= staysMs) this.#said = null;
    }
    return this.#said?.note ?? null;
  }
}
