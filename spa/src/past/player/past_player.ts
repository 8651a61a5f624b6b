import type { EventMessage } from '@posecast/wire';
import { isWithin } from '../../kit.ts';
import type { PastSource } from '../past_source.ts';
import {
  PAGE_MS,
  type PastControls,
  type PastEvent,
  type Playhead,
  type Span,
  type Speed,
  type Timeline,
} from '../past_types.ts';
import { Fill } from './around.ts';
import { searchFault } from './fault_search.ts';
import { KeyPageFetcher } from './key_page_fetcher.ts';
import { type PastPorts, PlayheadState } from './playhead_state.ts';
import { goSteps, playOn } from './playing.ts';
import { Projector } from './projector.ts';
import { jump, type PlayerParts, showWanted, want } from './seeking.ts';
import { listEvents, listRecentEvents } from './tape/happenings.ts';
import { Loads } from './tape/loads.ts';
import type { Alignment, OwnTape } from './tape/own_tape.ts';
import { AROUND_MAX, Reel } from './tape/reel.ts';
import { Tape, type TapeFrame } from './tape/tape.ts';

/** How far back it goes, ms: as long as footprints are kept. */
const LEAD_MS = 10_000;
/** Its maximum number of frames. */
export const LEAD_FRAMES_MAX = 300;

interface LeadInPorts {
  readonly source: PastSource;
  readonly own: OwnTape;
}

/** The states that led up to a frame, for values that depend on history: a velocity, footprints. It fetches nothing. */
class LeadIn {
  constructor(
    private readonly ports: LeadInPorts,
    private readonly tape: Tape,
    private readonly reel: Reel,
  ) {}

  /** The loaded frames before one, in its run, oldest first. */
  before(last: TapeFrame): readonly TapeFrame[] {
    const { source, own } = this.ports;
    const fromMs = last.atMs - LEAD_MS;
    const found = source
      .segmentsIn({ fromMs, toMs: last.atMs })
      .slice(-AROUND_MAX)
      .flatMap((ref) => (ref.frames > 0 ? this.reel.framesOf(ref) : []));
    this.tape.trim(last.atMs);
    return [...found, ...own.since(fromMs)]
      .filter(
        (frame) =>
          frame.atMs >= fromMs &&
          frame.runId === last.runId &&
          frame.schemaId === last.schemaId &&
          this.tape.order(frame, last) < 0,
      )
      .sort((a, b) => this.tape.order(a, b))
      .filter((frame, i, all) => i === 0 || this.tape.order(all[i - 1]!, frame) !== 0)
      .slice(-LEAD_FRAMES_MAX);
  }
}

/** A second press within this time continues from the fault of the first press, however far playback has moved since, ms. */
const AGAIN_MS = 3000;
/** While playing, going back skips a visit that started within this time, because it was just seen, ms. */
const PLAYED_MS = 1000;

/** Goes to the next or previous fault, unless the viewer does something else meanwhile. */
async function visitFault(parts: PlayerParts, by: 1 | -1): Promise<void> {
  const { ports, state } = parts;
  const { acts, visited, isPast, clock } = state;
  const isAgain = acts === visited.act + 1 && ports.nowMs() - visited.atMs < AGAIN_MS;
  const fromMs = isAgain ? visited.goesMs : state.hereMs;
  const slackMs = !isAgain && isPast && clock.running ? PLAYED_MS : 1;
  const isObsolete = () => acts !== state.acts;
  const mark = await searchFault(parts, by, fromMs, slackMs, isObsolete);
  if (mark === null || isObsolete()) return;
  state.visited = { goesMs: mark.goesMs, atMs: ports.nowMs(), act: acts };
  const keptMs = state.keptMs(mark.goesMs);
  state.leaveLoop(keptMs);
  state.enter();
  jump(parts, keptMs);
}

/**
 * Plays a robot's past into a sink: each frame in the segments, once and in order, and the page's own frames if there is no
 * segment (yet). `tick` must be called for every picture, except while it is resting.
 */
export class PastPlayer implements PastControls {
  readonly #parts: PlayerParts;
  readonly #state: PlayheadState;
  readonly #leadIn: LeadIn;
  readonly #unfollow: () => void;
  #deleted: readonly Span[] | undefined;
  readonly onChange: PastControls['onChange'];

  constructor(ports: PastPorts) {
    const { source, own, sink, schedule, nowMs, heard } = ports;
    const state = new PlayheadState(ports);
    const tape = new Tape();
    const work = () => this.#work();
    const loads = new Loads(source, tape, nowMs, inTurns(work, schedule));
    const reel = new Reel(source, tape, own, loads, (alignment) => this.#align(alignment));
    const projector = new Projector(sink, own, (momentMs) => listRecentEvents(source, heard(), momentMs));
    const keyFetcher = new KeyPageFetcher(source, loads, schedule);
    const fill = new Fill(ports, tape, reel, loads, () => {
      projector.isLed = false; // older segments may have arrived
      work();
    });
    this.#leadIn = new LeadIn(ports, tape, reel);
    const goLive = () => this.goLive();
    this.#parts = { ports, state, tape, loads, reel, projector, keyFetcher, fill, work, goLive };
    this.#state = state;
    this.onChange = state.onChange;
    this.#deleted = source.deleted;
    this.#unfollow = source.onChange(() => {
      this.#forgetDeleted();
      void keyFetcher.fetch();
      void keyFetcher.fetchDays();
      work();
      state.publish(true);
    });
  }

  get playhead(): Playhead {
    return this.#state.playhead;
  }

  /** The shown moment as of the newest `tick`; `playhead` is updated less often. */
  get momentMs(): number {
    return this.#state.clock.momentMs;
  }

  /** The shown frame; null if there is none, or while another moment is loading. */
  get frame(): TapeFrame | null {
    return this.#state.isPast && this.#state.wantedMs === null ? this.#parts.projector.cursor : null;
  }

  /** Creates a part that reads frames around the shown one, such as `Coming`, from what this player has loaded. */
  extend<T>(Part: new (ports: PastPorts, tape: Tape, reel: Reel, loads: Loads) => T): T {
    const { ports, tape, reel, loads } = this.#parts;
    return new Part(ports, tape, reel, loads);
  }

  /** Whether everything stays as it is until the viewer does something or data arrives: then `tick` has nothing to do. */
  get isResting(): boolean {
    const { isPast, clock, wantedMs, scrubbing, steps, playhead } = this.#state;
    const isBusy = clock.running || wantedMs !== null || scrubbing !== null || steps !== 0;
    return !isPast || (!isBusy && playhead.note === null);
  }

  get timeline(): Timeline | null {
    return this.#state.timeline;
  }

  get heard(): readonly EventMessage[] {
    return this.#parts.ports.heard();
  }

  get nowMs(): number {
    return this.#state.nowMs;
  }

  get behindMs(): number {
    return this.#parts.ports.own.behindMs;
  }

  close(): void {
    this.#unfollow();
    this.#parts.fill.stop();
    this.#parts.loads.keepOnly([]);
    this.#state.close();
  }

  attend(): void {
    if (this.#parts.keyFetcher.attend()) this.#parts.ports.source.follow('near');
  }

  look(span: Span): void {
    this.#parts.keyFetcher.look(span);
  }

  async loadDay(momentMs: number): Promise<boolean> {
    const isUnknown = ({ fromMs, toMs }: Span) => momentMs >= fromMs && momentMs < toMs;
    if (this.timeline?.unknown?.some(isUnknown)) await this.#parts.loads.day(momentMs);
    return this.timeline?.unknown?.some(isUnknown) !== true;
  }

  eventsIn(span: Span): readonly PastEvent[] {
    return listEvents(this.#parts.ports.source, this.heard, span);
  }

  async loadEvents(momentMs: number): Promise<boolean> {
    const page = Math.floor(momentMs / PAGE_MS);
    await this.#parts.loads.index(page);
    return this.#parts.loads.stateOf(`index ${page}`) === 'ready';
  }

  seek(momentMs: number, scrubbing = false): void {
    const state = this.#state;
    const isNewest = momentMs >= state.newestMs;
    state.act();
    if (isNewest && !scrubbing) {
      this.goLive();
      return;
    }
    const wantedMs = state.keptMs(momentMs);
    state.enter();
    if (!scrubbing) {
      state.leaveLoop(wantedMs);
      jump(this.#parts, wantedMs);
      return;
    }
    this.attend();
    state.scrubbing = { isNewest };
    want(this.#parts, wantedMs);
    void this.#parts.keyFetcher.want(wantedMs);
    this.#work();
  }

  settle(): void {
    const state = this.#state;
    const { scrubbing: scrubbed, clock } = state;
    if (scrubbed === null) return;
    state.act();
    if (scrubbed.isNewest) {
      this.goLive();
      return;
    }
    state.leaveLoop(clock.momentMs);
    jump(this.#parts, clock.momentMs);
  }

  toggle(): void {
    const state = this.#state;
    const { clock } = state;
    state.act();
    if (!state.isPast) {
      state.enter();
      state.rest();
      jump(this.#parts, this.#parts.ports.own.newest?.atMs ?? state.newestMs);
      return;
    }
    const nowMs = this.#parts.ports.nowMs();
    if (clock.running) state.rest();
    else clock.run(nowMs);
    if (clock.running && state.hasEnded) jump(this.#parts, state.oldestMs);
    state.shownMs = nowMs;
    state.steps = 0;
    this.#work();
  }

  setSpeed(speed: Speed): void {
    const state = this.#state;
    if (!state.isPast) return;
    state.move(state.clock.momentMs);
    state.clock.speed = speed;
    state.publish();
  }

  skip(byMs: number): void {
    this.seek(this.#state.hereMs + byMs);
  }

  step(by: 1 | -1): void {
    const state = this.#state;
    if (!state.isPast) this.toggle();
    this.settle();
    state.act();
    state.rest();
    state.steps += by;
    this.#work();
  }

  setLoop(span: Span | null): void {
    const state = this.#state;
    state.act();
    const fromMs = state.keptMs(span?.fromMs ?? 0);
    const toMs = state.keptMs(span?.toMs ?? 0);
    state.loop = toMs > fromMs ? { fromMs, toMs } : null;
    const { momentMs } = state.clock;
    if (state.loop === null || (state.isPast && momentMs >= fromMs && momentMs < toMs)) {
      state.publish();
      return;
    }
    state.enter();
    jump(this.#parts, fromMs);
  }

  visitFault(by: 1 | -1): void {
    this.#state.act();
    void visitFault(this.#parts, by);
  }

  goLive(): void {
    const state = this.#state;
    if (!state.isPast) return;
    state.act();
    if (state.recorded !== null) {
      state.loop = null;
      state.rest();
      jump(this.#parts, state.newestMs);
      return;
    }
    want(this.#parts, state.clock.momentMs);
    state.leave();
    this.#parts.loads.keepOnly([]);
    if (!this.#parts.keyFetcher.isAttended) this.#parts.ports.source.follow('idle');
    state.publish();
  }

  openAt(momentMs: number): void {
    const state = this.#state;
    state.act();
    state.enter();
    state.rest();
    state.askedMs = momentMs;
    jump(this.#parts, momentMs);
  }

  /** Shows everything due by now. */
  tick(): void {
    const state = this.#state;
    this.#work();
    if (!state.isPast) return;
    if (state.clock.running && state.wantedMs === null) playOn(this.#parts);
    else state.move(state.clock.momentMs);
    state.publish();
  }

  /** Drops what was deleted, and shows no more of it. */
  #forgetDeleted(): void {
    const { ports, state, tape } = this.#parts;
    const { deleted = [] } = ports.source;
    if (deleted === this.#deleted || deleted.length === 0) return;
    this.#deleted = deleted;
    tape.forget(deleted);
    ports.own.forget(deleted);
    if (!state.isPast) return;
    const { momentMs } = state.clock;
    if (isWithin(momentMs, deleted)) {
      if (state.timeline === null) this.goLive();
      else this.openAt(momentMs);
    } else if (state.wantedMs === null) jump(this.#parts, momentMs); // the faults of the minutes before may be deleted
  }

  /** Shows the requested moment as far as it is loaded, and fetches the rest. */
  #work(): void {
    const state = this.#state;
    if (!state.isPast) return;
    if (state.wantedMs === null) goSteps(this.#parts);
    else showWanted(this.#parts, state.wantedMs);
    state.publish();
    this.#lead();
    if (!this.isResting) this.#parts.ports.wake?.();
  }

  /** Sends the states that led up to the shown frame, once it rests. */
  #lead(): void {
    const { frame } = this;
    const { clock, scrubbing, steps } = this.#state;
    const { projector, ports } = this.#parts;
    if (frame === null || projector.isLed || clock.running || scrubbing !== null || steps !== 0) return;
    projector.isLed = true;
    ports.sink.lead(this.#leadIn.before(frame));
  }

  /** A segment has revealed the run and the moments of the page's own frames: moves the playhead along with the shown frame. */
  #align({ formerRun, runId, byMs }: Alignment): void {
    const { projector, state } = this.#parts;
    const { cursor } = projector;
    if (cursor?.runId !== formerRun) return;
    projector.cursor = { ...cursor, runId, atMs: cursor.atMs + byMs };
    if (state.wantedMs === null) state.move(state.clock.momentMs + byMs);
  }
}

/** Runs at the first call, and once more for all calls that follow before the browser has had its turn. */
function inTurns(run: () => void, schedule: PastPorts['schedule']): () => void {
  let calls = 0;
  const next = (): void => {
    const isAgain = calls > 1;
    calls = 0;
    if (isAgain) call();
  };
  const call = (): void => {
    calls += 1;
    if (calls > 1) return;
    schedule(next, 0);
    run();
  };
  return call;
}
