import type { EventMessage } from '@posecast/wire';
import type { Recorded } from '../../twin/liveness.ts';
import type { PastSource } from '../past_source.ts';
import type {
  PastControls,
  PastEvent,
  PastNote,
  PastSink,
  Playhead,
  Span,
  Speed,
  Timeline,
} from '../past_types.ts';
import { searchFault } from './fault_marks.ts';
import { Fill } from './fill.ts';
import { KeyPageFetcher } from './key_page_fetcher.ts';
import { Loads, PAGE_MS } from './loads.ts';
import { play, stepBack, stepOn } from './moves.ts';
import { LINK_NOTE_MS, PastNotes } from './notes.ts';
import type { Alignment, OwnTape } from './own_tape.ts';
import { PlayheadClock } from './playhead.ts';
import { Projector } from './projector.ts';
import { listEvents, listRecentEvents, pageBefore } from './recent_events.ts';
import { type Pending, Reel } from './reel.ts';
import { relayAhead } from './relay_now.ts';
import { Tape, type TapeFrame } from './tape.ts';

/** Longest time that a gap is played through, ms. */
export const GAP_MS = 2000;
/** Between two calls of the listeners while playing, ms. */
const CHANGE_EVERY_MS = 100;
/** A second press this soon goes on from the fault that the first went to, however far it has played since, ms. */
const AGAIN_MS = 3000;
/** A link's moment is not kept where nothing is recorded so near to it, ms. */
const LINK_APART_MS = 10_000;
const MINUTE_MS = 60_000;
const NAMES = ['at', 'playing', 'speed', 'loop', 'note'] as const;

export interface PastPorts {
  readonly source: PastSource;
  /** What the page itself received. */
  readonly own: OwnTape;
  readonly sink: PastSink;
  /** The events that the live stream has told, as far as they are remembered. */
  readonly heard: () => readonly EventMessage[];
  /** The page's clock, which never steps back. */
  readonly nowMs: () => number;
  /** Runs something some ms later. Returns a function that cancels it. */
  readonly schedule: (run: () => void, afterMs: number) => () => void;
  /** A recording, at whose end it rests; null or none where the present comes after the past. */
  readonly recorded?: Recorded | null;
}

/**
 * Plays a robot's past into a sink: each frame that the segments have, once and in order, and the page's own where there
 * is no segment (yet). `tick` has to be called for every picture while `playhead.at` is `past`.
 */
export class PastPlayer implements PastControls {
  readonly #ports: PastPorts;
  readonly #tape = new Tape();
  readonly #loads: Loads;
  readonly #reel: Reel;
  readonly #projector: Projector;
  readonly #keyFetcher: KeyPageFetcher;
  readonly #fill: Fill;
  readonly #clock = new PlayheadClock();
  readonly #notes = new PastNotes();
  readonly #listeners = new Set<() => void>();
  readonly #unfollow: () => void;
  readonly #recorded: Recorded | null;

  #isPast = false;
  #loop: Span | null = null;
  /** A finger is down. `isNewest`: at the newest end. */
  #scrubbing: { isNewest: boolean } | null = null;
  /** The moment whose exact state is not shown yet. */
  #wantedMs: number | null = null;
  /** The moment that a link names, while it is what is wanted or shown. */
  #askedMs: number | null = null;
  /** How far the relay's clock is ahead of the page's. */
  #aheadMs = Number.NEGATIVE_INFINITY;
  /** Frames to go. */
  #steps = 0;
  /** Counts the moments that were wanted. */
  #wants = 0;
  /** Counts what makes a search for faults obsolete. */
  #acts = 0;
  /** The newest visit to a fault: to where, when by the page's clock, and as which of the acts. */
  #visited = { goesMs: 0, atMs: Number.NEGATIVE_INFINITY, act: 0 };
  /** When something was last shown, page's clock. */
  #shownMs = 0;
  #playhead: Playhead;
  #changedMs = 0;

  constructor(ports: PastPorts) {
    this.#ports = ports;
    const { source, own, sink, nowMs, recorded = null } = ports;
    this.#recorded = recorded;
    this.#isPast = recorded !== null;
    if (recorded !== null) this.#clock.set(recorded.fromMs, nowMs());
    this.#loads = new Loads(source, this.#tape, nowMs, () => this.#work());
    this.#reel = new Reel(source, this.#tape, own, this.#loads, (alignment) => this.#align(alignment));
    const listRecent = (momentMs: number) => listRecentEvents(source, ports.heard(), momentMs);
    this.#projector = new Projector(sink, own, listRecent);
    this.#keyFetcher = new KeyPageFetcher(source, this.#loads, ports.schedule);
    this.#fill = new Fill(ports, this.#tape, this.#reel, this.#loads);
    this.#playhead = this.#read();
    this.#unfollow = source.onChange(() => {
      void this.#keyFetcher.fetch();
      void this.#keyFetcher.fetchDays();
      this.#work();
      this.#publish(true);
    });
  }

  get playhead(): Playhead {
    return this.#playhead;
  }

  /** The shown moment as of the newest `tick`; `playhead` is told less often. */
  get momentMs(): number {
    return this.#clock.momentMs;
  }

  /** The shown frame; null while none is, or another moment is on its way. */
  get frame(): TapeFrame | null {
    return this.#isPast && this.#wantedMs === null ? this.#projector.cursor : null;
  }

  /** Makes what looks beyond the shown frame, with what has been loaded here. */
  extend<T>(Part: new (ports: PastPorts, tape: Tape, reel: Reel, loads: Loads) => T): T {
    return new Part(this.#ports, this.#tape, this.#reel, this.#loads);
  }

  get timeline(): Timeline | null {
    return this.#ports.source.timeline;
  }

  get heard(): readonly EventMessage[] {
    return this.#ports.heard();
  }

  get nowMs(): number {
    if (this.#recorded !== null) return this.#recorded.toMs;
    const pageMs = this.#ports.nowMs();
    const toMs = this.timeline?.toMs ?? Number.NEGATIVE_INFINITY;
    this.#aheadMs = relayAhead(this.#aheadMs, { toMs }, this.#playhead, pageMs);
    return pageMs + this.#aheadMs;
  }

  readonly onChange = (listener: () => void): (() => void) => {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  };

  close(): void {
    this.#unfollow();
    this.#fill.stop();
    this.#loads.keepOnly([]);
    this.#isPast = false;
    this.#listeners.clear();
  }

  attend(): void {
    if (this.#keyFetcher.attend()) this.#ports.source.follow('near');
  }

  look(span: Span): void {
    this.#keyFetcher.look(span);
  }

  async loadDay(momentMs: number): Promise<boolean> {
    const isUnknown = ({ fromMs, toMs }: Span) => momentMs >= fromMs && momentMs < toMs;
    if (this.timeline?.unknown?.some(isUnknown)) await this.#loads.day(momentMs);
    return this.timeline?.unknown?.some(isUnknown) !== true;
  }

  eventsIn(span: Span): readonly PastEvent[] {
    return listEvents(this.#ports.source, this.heard, span);
  }

  async loadEvents(momentMs: number): Promise<boolean> {
    const page = Math.floor(momentMs / PAGE_MS);
    await this.#loads.index(page);
    return this.#loads.stateOf(`index ${page}`) === 'ready';
  }

  seek(momentMs: number, scrubbing = false): void {
    const isNewest = momentMs >= this.#newestMs();
    this.#act();
    if (isNewest && !scrubbing) {
      this.goLive();
      return;
    }
    const wantedMs = this.#keptMs(momentMs);
    this.#enter();
    if (!scrubbing) {
      this.#leaveLoop(wantedMs);
      this.#jump(wantedMs);
      return;
    }
    this.attend();
    this.#scrubbing = { isNewest };
    this.#want(wantedMs);
    void this.#keyFetcher.want(wantedMs);
    this.#work();
  }

  settle(): void {
    const scrubbed = this.#scrubbing;
    if (scrubbed === null) return;
    this.#act();
    if (scrubbed.isNewest) {
      this.goLive();
      return;
    }
    this.#leaveLoop(this.#clock.momentMs);
    this.#jump(this.#clock.momentMs);
  }

  toggle(): void {
    this.#act();
    if (!this.#isPast) {
      this.#enter();
      this.#rest();
      this.#jump(this.#ports.own.newest?.atMs ?? this.#newestMs());
      return;
    }
    const nowMs = this.#ports.nowMs();
    if (this.#clock.running) this.#rest();
    else this.#clock.run(nowMs);
    if (this.#clock.running && this.#hasEnded()) this.#jump(this.#oldestMs());
    this.#shownMs = nowMs;
    this.#steps = 0;
    this.#work();
  }

  setSpeed(speed: Speed): void {
    if (!this.#isPast) return;
    this.#clock.set(this.#clock.momentMs, this.#ports.nowMs());
    this.#clock.speed = speed;
    this.#publish();
  }

  skip(byMs: number): void {
    this.seek((this.#isPast ? this.#clock.momentMs : this.#newestMs()) + byMs);
  }

  step(by: 1 | -1): void {
    if (!this.#isPast) this.toggle();
    this.settle();
    this.#act();
    this.#rest();
    this.#steps += by;
    this.#work();
  }

  setLoop(span: Span | null): void {
    this.#act();
    const fromMs = this.#keptMs(span?.fromMs ?? 0);
    const toMs = this.#keptMs(span?.toMs ?? 0);
    this.#loop = toMs > fromMs ? { fromMs, toMs } : null;
    const { momentMs } = this.#clock;
    if (this.#loop === null || (this.#isPast && momentMs >= fromMs && momentMs < toMs)) {
      this.#publish();
      return;
    }
    this.#enter();
    this.#jump(fromMs);
  }

  visitFault(by: 1 | -1): void {
    this.#act();
    void this.#visit(by, this.#isPast ? this.#clock.momentMs : this.#newestMs(), this.#acts);
  }

  goLive(): void {
    if (!this.#isPast) return;
    this.#act();
    if (this.#recorded !== null) {
      this.#loop = null;
      this.#rest();
      this.#jump(this.#newestMs());
      return;
    }
    this.#want(this.#clock.momentMs);
    this.#wantedMs = null;
    this.#isPast = false;
    this.#loop = null;
    this.#scrubbing = null;
    this.#clock.running = false;
    this.#clock.speed = 1;
    this.#loads.keepOnly([]);
    if (!this.#keyFetcher.isAttended) this.#ports.source.follow('idle');
    this.#publish();
  }

  openAt(momentMs: number): void {
    this.#act();
    this.#enter();
    this.#rest();
    this.#askedMs = momentMs;
    this.#jump(momentMs);
  }

  /** Shows what has come to be shown by now. */
  tick(): void {
    this.#work();
    if (!this.#isPast) return;
    if (this.#clock.running && this.#wantedMs === null) this.#play();
    else this.#clock.set(this.#clock.momentMs, this.#ports.nowMs());
    this.#publish();
  }

  /** Somebody did something, so what was said before holds no longer. */
  #act(): void {
    this.#acts += 1;
    this.#notes.forget();
    this.#askedMs = null;
  }

  /** Who goes out of what is repeated is told that it ends. */
  #leaveLoop(momentMs: number): void {
    if (this.#loop === null || (momentMs >= this.#loop.fromMs && momentMs <= this.#loop.toMs)) return;
    this.#loop = null;
    this.#say('unlooped');
  }

  #enter(): void {
    if (this.#isPast) return;
    this.#isPast = true;
    this.#clock.run(this.#ports.nowMs());
    this.#ports.source.follow('near');
  }

  #rest(): void {
    this.#clock.running = false;
    this.#notes.rest();
  }

  #jump(momentMs: number): void {
    this.#scrubbing = null;
    this.#keyFetcher.stop();
    this.#want(momentMs);
    const { source } = this.#ports;
    this.#loads.keepOnly(source.segmentsIn({ fromMs: momentMs - MINUTE_MS, toMs: momentMs + MINUTE_MS / 2 }));
    this.#work();
  }

  #want(momentMs: number): void {
    const nowMs = this.#ports.nowMs();
    this.#fill.stop();
    this.#clock.set(momentMs, nowMs);
    this.#wantedMs = momentMs;
    this.#wants += 1;
    this.#steps = 0;
    this.#shownMs = nowMs;
    this.#notes.rest();
  }

  /** Shows what is wanted as far as it is here, and fetches what is not. */
  #work(): void {
    if (!this.#isPast) return;
    if (this.#wantedMs === null) this.#step();
    else if (this.#scrubbing !== null) this.#scrub(this.#wantedMs);
    else this.#showAt(this.#wantedMs);
    this.#publish();
  }

  /** Shows what is here of a moment, exactly or nearly. */
  #scrub(momentMs: number): void {
    const { frame, situation } = this.#reel.at(momentMs);
    const { cursor } = this.#projector;
    if (frame === null || situation === null) this.#showKey(momentMs);
    else if (frame.seq !== cursor?.seq || frame.runId !== cursor.runId)
      this.#projector.show(frame, momentMs, situation);
  }

  /** Shows a moment exactly, as soon as that is here. */
  #showAt(momentMs: number): void {
    if (this.#hasLeft(momentMs)) return;
    const nowMs = this.#ports.nowMs();
    const { frame, situation, pending, isDamaged } = this.#reel.at(momentMs);
    for (const each of pending) each.begin();
    const isUnknown = this.timeline === null && (frame === null || this.#askedMs !== null);
    if (situation === null || isUnknown) {
      this.#notes.wait(pending, nowMs);
      this.#showKey(momentMs);
      return;
    }
    if (this.#askedMs !== null && situation.word === 'online' && this.#goNearer(momentMs, frame)) return;
    const shownMs = Math.max(momentMs, frame?.atMs ?? 0);
    this.#projector.show(frame, shownMs, situation);
    this.#clock.set(shownMs, nowMs);
    this.#shownMs = nowMs;
    this.#wantedMs = null;
    this.#changedMs = Number.NEGATIVE_INFINITY; // it is told at once
    this.#notes.rest();
    if (isDamaged) this.#say('damaged');
    const isApart = frame === null || Math.abs((this.#askedMs ?? momentMs) - frame.atMs) > LINK_APART_MS;
    if (this.#askedMs !== null && isApart && situation.word === 'online') this.#say('not-kept');
    if (frame !== null) this.#fill.soon(frame);
    void this.#recall(shownMs);
  }

  /** From a moment that was named, at which nothing was recorded, goes to what was, before it or after, if that is not near. */
  #goNearer(momentMs: number, before: TapeFrame | null): boolean {
    const agoMs = before === null ? Number.POSITIVE_INFINITY : momentMs - before.atMs;
    if (agoMs <= LINK_APART_MS) return false;
    const nextMs = this.#reel.nextMs(null, momentMs);
    const nearestMs = nextMs !== null && nextMs - momentMs < agoMs ? nextMs : (before?.atMs ?? momentMs);
    if (nearestMs === momentMs) return false;
    this.#jump(nearestMs);
    return true;
  }

  /** Learns which faults there were in the ten minutes before, as far as another page has them, and shows the moment again
   *  with them. */
  async #recall(shownMs: number): Promise<void> {
    const page = pageBefore(this.#ports.source, shownMs);
    const wants = this.#wants;
    if (page === null || this.#loads.stateOf(`index ${page}`) === 'ready') return;
    await this.#loads.index(page);
    if (wants !== this.#wants || !this.#isPast || this.#steps !== 0) return;
    if (this.#loads.stateOf(`index ${page}`) === 'ready') this.#jump(this.#clock.momentMs);
  }

  /** Shows the first pose of a segment near a moment. */
  #showKey(momentMs: number): void {
    const { source } = this.#ports;
    const pose = source.keyAt(momentMs);
    if (pose === null) return;
    const reader = this.#loads.knownReader(pose.schema);
    if (reader === null) {
      this.#loads.reader(pose.schema).then(
        () => this.#work(),
        () => undefined,
      );
      return;
    }
    const refs = source.segmentsIn({ fromMs: pose.atMs - MINUTE_MS, toMs: pose.atMs });
    const word = refs.flatMap(({ words }) => words).findLast(({ atMs }) => atMs <= pose.atMs)?.word ?? null;
    this.#projector.showKey(pose, reader, word);
  }

  /** Goes to the nearest moment that is kept if one is not. */
  #hasLeft(momentMs: number): boolean {
    const keptMs = this.#keptMs(momentMs);
    if (this.timeline === null || keptMs === momentMs) return false;
    const askedMs = this.#askedMs;
    if (askedMs !== null && askedMs > this.nowMs && this.#recorded === null) {
      this.goLive();
      this.#askedMs = askedMs;
      this.#say('not-come');
      this.#ports.schedule(() => this.#publish(), LINK_NOTE_MS);
      return true;
    }
    if (askedMs !== null) this.#say('not-kept');
    else if (keptMs > momentMs) this.#say('resumed');
    this.#jump(keptMs);
    return true;
  }

  /** Plays up to now. */
  #play(): void {
    const nowMs = this.#ports.nowMs();
    const looped = this.#loop?.toMs ?? this.#recorded?.toMs ?? Number.POSITIVE_INFINITY;
    this.#reel.near({ fromMs: this.#clock.momentMs, toMs: this.#clock.target(nowMs) }); // may move the playhead
    const targetMs = Math.min(this.#clock.target(nowMs), looped);
    const move = play(this.#reel, this.#projector, this.#clock.momentMs, targetMs);
    const { momentMs, blockers, hasShown, isDamaged } = move;
    this.#clock.set(momentMs, nowMs);
    this.#await(blockers);
    if (isDamaged) this.#say('damaged');
    this.#prefetch();
    if (this.#loop === null && this.#hasEnded()) this.#rest();
    else if (momentMs >= looped) this.#jump(this.#loop!.fromMs);
    else if (hasShown) this.#shownMs = nowMs;
    else if (momentMs >= this.#oldestMs() || !this.#hasLeft(momentMs))
      this.#pass(blockers.length > 0, momentMs, nowMs);
  }

  /** Passes over what is long empty. At the end comes what is live. */
  #pass(isHeld: boolean, momentMs: number, nowMs: number): void {
    const isLong = nowMs - this.#shownMs >= GAP_MS;
    if (isHeld || (!isLong && this.#clock.speed <= 1)) return;
    const nextMs = this.#reel.nextMs(this.#projector.cursor, momentMs);
    const isFar = nextMs === null || nextMs - momentMs > GAP_MS;
    const unknown = isFar ? this.#reel.unknownAfter(momentMs, nextMs ?? Number.POSITIVE_INFINITY) : null;
    if (unknown !== null) this.#await([this.#reel.dayOf(unknown)]);
    else if (nextMs === null) {
      if (this.#loop !== null) this.#jump(this.#loop.fromMs);
      else if (isLong || momentMs >= this.#newestMs()) this.goLive();
    } else if (isLong && nextMs - (this.#projector.cursor?.atMs ?? momentMs) > GAP_MS) {
      this.#clock.set(Math.min(nextMs, this.#loop?.toMs ?? nextMs), nowMs);
      this.#shownMs = nowMs;
    }
  }

  #prefetch(): void {
    const { momentMs, speed } = this.#clock;
    for (const ref of this.#reel.ahead(momentMs, speed > 2 ? 6 : 2)) void this.#loads.segment(ref);
    const soonMs = momentMs + MINUTE_MS / 2;
    if (soonMs <= (this.timeline?.toMs ?? 0)) void this.#loads.index(Math.floor(soonMs / PAGE_MS));
    this.#tape.trim(momentMs);
  }

  /** Goes frame by frame, as far as frames are here. */
  #step(): void {
    while (this.#steps !== 0) {
      const step = this.#steps > 0 ? stepOn : stepBack;
      const { momentMs, blockers } = step(this.#reel, this.#projector, this.#clock.momentMs);
      this.#await(blockers);
      if (blockers.length > 0) return;
      this.#clock.set(momentMs, this.#ports.nowMs());
      if (this.#steps < 0 && this.#projector.cursor !== null) this.#fill.soon(this.#projector.cursor);
      this.#steps -= Math.sign(this.#steps);
    }
  }

  async #visit(by: 1 | -1, momentMs: number, act: number): Promise<void> {
    const { goesMs, atMs, act: before } = this.#visited;
    const isAgain = act === before + 1 && this.#ports.nowMs() - atMs < AGAIN_MS;
    const fromMs = isAgain ? goesMs : momentMs;
    const slackMs = !isAgain && this.#isPast && this.#clock.running ? 1000 : 1;
    const isLeft = () => act !== this.#acts;
    const parts = { source: this.#ports.source, reel: this.#reel, loads: this.#loads };
    const mark = await searchFault(parts, by, fromMs, slackMs, isLeft);
    if (mark === null || isLeft()) return;
    this.#visited = { goesMs: mark.goesMs, atMs: this.#ports.nowMs(), act };
    this.#leaveLoop(this.#keptMs(mark.goesMs));
    this.#enter();
    this.#jump(this.#keptMs(mark.goesMs));
  }

  /** Own frames are known to be of a run now, and when they were: the playhead stays with the frame that it shows. */
  #align({ formerRun, runId, byMs }: Alignment): void {
    const { cursor } = this.#projector;
    if (cursor?.runId !== formerRun) return;
    this.#projector.cursor = { ...cursor, runId, atMs: cursor.atMs + byMs };
    if (this.#wantedMs === null) this.#clock.set(this.#clock.momentMs + byMs, this.#ports.nowMs());
  }

  #await(pending: readonly Pending[]): void {
    for (const each of pending) each.begin();
    if (pending.length === 0) this.#notes.rest();
    else this.#notes.wait(pending, this.#ports.nowMs());
  }

  #say(note: PastNote): void {
    this.#notes.say(note, this.#ports.nowMs());
  }

  #oldestMs(): number {
    return this.timeline?.fromMs ?? Number.NEGATIVE_INFINITY;
  }

  /** The newest moment that is known. */
  #newestMs(): number {
    const { own } = this.#ports;
    const recordedMs = this.timeline?.toMs ?? Number.NEGATIVE_INFINITY;
    if (!this.#isPast && this.timeline !== null) own.guess(recordedMs);
    const newestMs = Math.max(recordedMs, own.newest?.atMs ?? Number.NEGATIVE_INFINITY);
    return Number.isFinite(newestMs) ? newestMs : this.#ports.nowMs();
  }

  /** The nearest moment that is kept. */
  #keptMs(momentMs: number): number {
    return Math.max(Math.min(momentMs, this.#newestMs()), this.#oldestMs());
  }

  #read(): Playhead {
    const { momentMs, running: playing, speed } = this.#clock;
    const said = {
      note: this.#notes.read(this.#ports.nowMs()),
      askedMs: this.#askedMs,
      recorded: this.#recorded,
    };
    if (!this.#isPast)
      return { at: 'live', momentMs: this.#newestMs(), playing: true, speed: 1, loop: null, ...said };
    return { at: 'past', momentMs, playing, speed, loop: this.#loop, ...said };
  }

  /** Whether a recording is at its end. */
  #hasEnded(): boolean {
    return this.#recorded !== null && this.#clock.momentMs >= this.#recorded.toMs;
  }

  /** Tells the listeners what has changed: a moment that only goes on not too often. */
  #publish(always = false): void {
    const [before, now] = [this.#playhead, this.#read()];
    const nowMs = this.#ports.nowMs();
    if (!always && NAMES.every((name) => before[name] === now[name])) {
      const goesOn = now.playing && this.#scrubbing === null && this.#wantedMs === null;
      if (before.momentMs === now.momentMs || (goesOn && nowMs - this.#changedMs < CHANGE_EVERY_MS)) return;
    }
    this.#changedMs = nowMs;
    this.#playhead = now;
    for (const listener of this.#listeners) listener();
  }
}
