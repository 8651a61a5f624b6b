import { faultBeside } from './fault_marks.ts';
import { Fill } from './fill.ts';
import { KeyPages } from './key_pages.ts';
import { Loads, PAGE_MS } from './loads.ts';
import type { Alignment, OwnTape } from './own_tape.ts';
import type { PastSource } from './past_source.ts';
import type { PastControls, PastNote, PastSink, Playhead, Span, Speed, Timeline } from './past_types.ts';
import { PlayheadClock } from './playhead.ts';
import { Projector } from './projector.ts';
import { APART_MS, PATIENCE_MS, type Pending, Reel } from './reel.ts';
import { Tape } from './tape.ts';

/** Longest time that a gap is played through, ms. */
export const GAP_MS = 2000;
/** Between two calls of the listeners while playing, ms. */
const CHANGE_EVERY_MS = 100;
/** How long a note stays that nothing else ends, ms. */
const NOTE_MS = 5000;
/** A link's moment is not kept where nothing is recorded so near to it, ms. */
const LINK_APART_MS = 10_000;
const MINUTE_MS = 60_000;
const NAMES = ['at', 'playing', 'speed', 'loop', 'note'] as const;

export interface PastPorts {
  readonly source: PastSource;
  /** What the page itself received. */
  readonly own: OwnTape;
  readonly sink: PastSink;
  /** The page's clock, which never steps back. */
  readonly nowMs: () => number;
  /** Runs something some ms later. Returns a function that cancels it. */
  readonly schedule: (run: () => void, afterMs: number) => () => void;
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
  readonly #keyPages: KeyPages;
  readonly #fill: Fill;
  readonly #clock = new PlayheadClock();
  readonly #listeners = new Set<() => void>();
  readonly #unfollow: () => void;

  #isPast = false;
  #loop: Span | null = null;
  #isAttended = false;
  /** A finger is down. `isNewest`: at the newest end. */
  #scrubbing: { isNewest: boolean } | null = null;
  /** The moment whose exact state is not shown yet. */
  #wantedMs: number | null = null;
  /** The wanted moment is that of a link. */
  #isLink = false;
  /** Frames to go. */
  #steps = 0;
  /** Counts what makes a search for faults obsolete. */
  #acts = 0;
  /** When something was last shown, page's clock. */
  #shownMs = 0;
  /** Since when something is waited for, page's clock. */
  #waitingMs: number | null = null;
  #isAway = false;
  #note: { note: PastNote; sinceMs: number } | null = null;
  #playhead: Playhead;
  #changedMs = 0;

  constructor(ports: PastPorts) {
    this.#ports = ports;
    const { source, own, sink, nowMs } = ports;
    this.#loads = new Loads(source, this.#tape, nowMs, () => this.#work());
    this.#reel = new Reel(source, this.#tape, own, this.#loads, (alignment) => this.#align(alignment));
    this.#projector = new Projector(sink, own);
    this.#keyPages = new KeyPages(source, this.#loads);
    this.#fill = new Fill(ports, this.#tape, this.#reel, this.#loads);
    this.#playhead = this.#read();
    this.#unfollow = source.onChange(() => {
      if (this.#isAttended) void this.#keyPages.fetch();
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

  get timeline(): Timeline | null {
    return this.#ports.source.timeline;
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
    if (this.#isAttended) return;
    this.#isAttended = true;
    this.#ports.source.follow('near');
    void this.#keyPages.fetch();
  }

  seek(momentMs: number, scrubbing = false): void {
    const isNewest = momentMs >= this.#newestMs();
    this.#act();
    if (isNewest && !scrubbing) {
      this.goLive();
      return;
    }
    const wantedMs = this.#keptMs(momentMs);
    if (this.#loop !== null && (wantedMs < this.#loop.fromMs || wantedMs > this.#loop.toMs))
      this.#loop = null;
    this.#enter();
    if (!scrubbing) {
      this.#jump(wantedMs);
      return;
    }
    this.attend();
    this.#scrubbing = { isNewest };
    this.#want(wantedMs);
    void this.#keyPages.want(wantedMs);
    this.#work();
  }

  settle(): void {
    const scrubbed = this.#scrubbing;
    if (scrubbed === null) return;
    this.#act();
    if (scrubbed.isNewest) this.goLive();
    else this.#jump(this.#clock.momentMs);
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
    this.#want(this.#clock.momentMs);
    this.#wantedMs = null;
    this.#isPast = false;
    this.#loop = null;
    this.#scrubbing = null;
    this.#clock.running = false;
    this.#clock.speed = 1;
    this.#loads.keepOnly([]);
    if (!this.#isAttended) this.#ports.source.follow('idle');
    this.#publish();
  }

  /** Shows the moment that a link names, and rests there; if it is not kept, the nearest that is, and says so. */
  openAt(momentMs: number): void {
    this.#act();
    this.#enter();
    this.#rest();
    this.#isLink = true;
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
    this.#note = null;
    this.#isLink = false;
  }

  #enter(): void {
    if (this.#isPast) return;
    const { source, own, nowMs } = this.#ports;
    this.#isPast = true;
    this.#clock.run(nowMs());
    if (source.timeline !== null) own.guess(source.timeline.toMs);
    source.follow('near');
  }

  #rest(): void {
    this.#clock.running = false;
    this.#wait([]);
  }

  #jump(momentMs: number): void {
    this.#scrubbing = null;
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
    this.#steps = 0;
    this.#shownMs = nowMs;
    this.#wait([]);
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
    const { frame, situation, pending, isDamaged } = this.#reel.at(momentMs);
    for (const each of pending) each.begin();
    const isUnknown = frame === null && this.timeline === null;
    if (situation === null || isUnknown) {
      this.#waitingMs ??= this.#ports.nowMs();
      this.#isAway = pending.some(({ state }) => state === 'away');
      this.#showKey(momentMs);
      return;
    }
    const shownMs = Math.max(momentMs, frame?.atMs ?? 0);
    this.#projector.show(frame, shownMs, situation);
    this.#clock.set(shownMs, this.#ports.nowMs());
    this.#shownMs = this.#ports.nowMs();
    this.#wantedMs = null;
    this.#wait([]);
    if (isDamaged) this.#say('damaged');
    const isApart = frame === null || Math.abs(momentMs - frame.atMs) > LINK_APART_MS;
    if (this.#isLink && isApart && situation.word === 'online') this.#say('not-kept');
    if (frame !== null) this.#fill.soon(frame);
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
    if (this.#isLink) this.#say('not-kept');
    else if (keptMs > momentMs) this.#say('resumed');
    this.#jump(keptMs);
    return true;
  }

  /** Plays up to now. */
  #play(): void {
    const nowMs = this.#ports.nowMs();
    const looped = this.#loop?.toMs ?? Number.POSITIVE_INFINITY;
    const aheadMs = this.#clock.target(nowMs) + APART_MS;
    const near = this.#reel.near({ fromMs: this.#clock.momentMs - APART_MS, toMs: aheadMs });
    const { momentMs } = this.#clock; // looking may have moved it
    const targetMs = Math.min(this.#clock.target(nowMs), looped);
    let heldMs = Number.POSITIVE_INFINITY;
    let blockers: readonly Pending[] = [];
    for (;;) {
      const next = this.#reel.next(near, this.#projector.cursor, momentMs);
      blockers = this.#reel.blockers(near, next, momentMs);
      const nextMs = next?.frame.atMs ?? Number.POSITIVE_INFINITY;
      if (blockers.length > 0) heldMs = Math.min(nextMs, ...blockers.map(({ fromMs }) => fromMs));
      if (next === null || nextMs > targetMs || blockers.length > 0) break;
      this.#projector.deliver(next, near);
      this.#shownMs = nowMs;
    }
    const reachedMs = Math.max(momentMs, Math.min(targetMs, heldMs));
    this.#projector.tell(near, reachedMs);
    this.#clock.set(reachedMs, nowMs);
    const isHeld = heldMs <= targetMs;
    this.#await(isHeld ? blockers : []);
    if (near.damaged.some(({ fromMs, toMs }) => fromMs <= reachedMs && toMs >= momentMs))
      this.#say('damaged');
    this.#prefetch();
    if (this.#shownMs === nowMs && reachedMs < looped) return;
    if (reachedMs >= looped) this.#jump(this.#loop!.fromMs);
    else if (reachedMs >= this.#oldestMs() || !this.#hasLeft(reachedMs)) this.#pass(isHeld, reachedMs, nowMs);
  }

  /** Passes over what is long empty. At the end comes what is live. */
  #pass(isHeld: boolean, momentMs: number, nowMs: number): void {
    const isLong = nowMs - this.#shownMs >= GAP_MS;
    if (isHeld || (!isLong && this.#clock.speed <= 1)) return;
    const nextMs = this.#reel.nextMs(this.#projector.cursor, momentMs);
    if (nextMs === null) {
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
      const pending = this.#steps > 0 ? this.#stepOn() : this.#stepBack();
      this.#await(pending);
      if (pending.length > 0) return;
      this.#steps -= Math.sign(this.#steps);
    }
  }

  /** Shows the next frame. What has to come before. */
  #stepOn(): readonly Pending[] {
    const { cursor } = this.#projector;
    const momentMs = cursor?.atMs ?? this.#clock.momentMs;
    const nextMs = this.#reel.nextMs(cursor, momentMs) ?? momentMs;
    const near = this.#reel.near({ fromMs: momentMs - APART_MS, toMs: nextMs + APART_MS });
    const next = this.#reel.next(near, this.#projector.cursor, momentMs);
    const blockers = this.#reel.blockers(near, next, momentMs);
    if (blockers.length > 0 || next === null) return blockers;
    this.#projector.deliver(next, near);
    this.#clock.set(next.frame.atMs, this.#ports.nowMs());
    return [];
  }

  /** Shows the frame before, likewise. */
  #stepBack(): readonly Pending[] {
    const { cursor } = this.#projector;
    if (cursor === null) return [];
    const { frame, pending } = this.#reel.before(cursor);
    if (frame === null) return pending;
    const { situation, pending: more } = this.#reel.at(frame.atMs);
    if (situation === null) return more;
    this.#projector.show(frame, frame.atMs, situation);
    this.#clock.set(frame.atMs, this.#ports.nowMs());
    this.#fill.soon(frame);
    return [];
  }

  async #visit(by: 1 | -1, momentMs: number, act: number): Promise<void> {
    const slackMs = this.#isPast && this.#clock.running ? 1000 : 1;
    for (let tries = 0; ; tries += 1) {
      const mark = faultBeside(this.timeline?.marks ?? [], by, momentMs, slackMs);
      if (mark === null) return;
      if (mark.exact || tries > 1) {
        this.#loop = null;
        this.#enter();
        this.#jump(this.#keptMs(mark.goesMs));
        return;
      }
      await this.#loads.index(Math.floor(mark.atMs / PAGE_MS));
      if (act !== this.#acts) return;
    }
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
    this.#wait(pending);
  }

  #wait(pending: readonly Pending[]): void {
    if (pending.length === 0) this.#waitingMs = null;
    else this.#waitingMs ??= this.#ports.nowMs();
    this.#isAway = pending.some(({ state }) => state === 'away');
  }

  #say(note: PastNote): void {
    this.#note = { note, sinceMs: this.#ports.nowMs() };
  }

  #oldestMs(): number {
    return this.timeline?.fromMs ?? Number.NEGATIVE_INFINITY;
  }

  /** The newest moment that is known. */
  #newestMs(): number {
    const ownMs = this.#ports.own.newest?.atMs ?? Number.NEGATIVE_INFINITY;
    const newestMs = Math.max(ownMs, this.timeline?.toMs ?? Number.NEGATIVE_INFINITY);
    return Number.isFinite(newestMs) ? newestMs : this.#ports.nowMs();
  }

  /** The nearest moment that is kept. */
  #keptMs(momentMs: number): number {
    return Math.max(Math.min(momentMs, this.#newestMs()), this.#oldestMs());
  }

  #readNote(): PastNote | null {
    const nowMs = this.#ports.nowMs();
    if (this.#isAway) return 'away';
    if (this.#waitingMs !== null && nowMs - this.#waitingMs > PATIENCE_MS) return 'loading';
    const said = this.#note;
    if (said !== null && said.note !== 'not-kept' && nowMs - said.sinceMs > NOTE_MS) this.#note = null;
    return this.#note?.note ?? null;
  }

  #read(): Playhead {
    const { momentMs, running: playing, speed } = this.#clock;
    if (!this.#isPast)
      return { at: 'live', momentMs: this.#newestMs(), playing: true, speed: 1, loop: null, note: null };
    return { at: 'past', momentMs, playing, speed, loop: this.#loop, note: this.#readNote() };
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
