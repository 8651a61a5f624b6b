import { decodeSegment, type RobotStatus, type Segment, SegmentError } from '@posecast/wire';
import type { KnownBefore } from '../lane_port.ts';
import type { FromStream } from '../messages.ts';
import { RateMeter } from '../pacing.ts';
import { type LaneAnswer, type PartName, readBeginning, readNext } from './answers.ts';
import { LookBack, type MissedEvents } from './missed_events.ts';
import { PartPlayer } from './part_player.ts';
import { PlayClock } from './play_clock.ts';

/** Requests that may follow one another at once: the lane's starting point, its newest part, the schema, the next part. */
const BURST = 4;
const EVERY_MS = 1000;

/** Half a request is credited for each part received: a page that is behind must read faster than a robot sends. */
const FOR_A_PART = 0.5;

/** Allows one request a second on average, and a few at once after a rest, whatever the relay answers; two a second if each
 *  brings a part. */
class RequestPace {
  #left = BURST;
  #atMs = Number.NEGATIVE_INFINITY;

  /** When the next request may be sent. */
  whenFree(nowMs: number): number {
    this.#refill(nowMs);
    return this.#left >= 1 ? nowMs : nowMs + (1 - this.#left) * EVERY_MS;
  }

  recordRequest(nowMs: number): void {
    this.#refill(nowMs);
    this.#left -= 1;
  }

  recordPart(): void {
    this.#left = Math.min(BURST, this.#left + FOR_A_PART);
  }

  #refill(nowMs: number): void {
    this.#left = Math.min(BURST, this.#left + (nowMs - this.#atMs) / EVERY_MS);
    this.#atMs = nowMs;
  }
}

/** After this many consecutive parts that already existed, the end of the past is requested again. */
const LOOK_EVERY = 3;
/** If parts were missed, at most this many are fetched for their events; beyond that the lane skips to the newest. */
const MISSED_MAX = 3;

/** Tracks whether the lane has reached the end of the recorded data: it has if a request was held, or was answered with "not
 *  yet". The starting point may be long past, because a cache may serve an old answer. In that case the lane reads on at once,
 *  and asks for the end again now and then. */
class EndOfPast {
  /** Consecutive parts that already existed. */
  #ready = 0;
  /** The last known newest part. */
  #told: PartName | null = null;

  recordPart(wasHeld: boolean): void {
    this.#ready = wasHeld ? 0 : this.#ready + 1;
  }

  recordNotYet(): void {
    this.#ready = 0;
  }

  /** A single such part may just have been requested too late; two mean that the lane is behind. */
  get isNear(): boolean {
    return this.#ready < 2;
  }

  get isToBeAsked(): boolean {
    return this.#ready > 0 && this.#ready % LOOK_EVERY === 0;
  }

  /** The next part of the lane: the one after the last, unless the newest is so far ahead that the picture is now too old. An
   *  answer received earlier came from a cache. */
  goOn(last: PartName | null, newest: PartName): PartName {
    const told = this.#told;
    this.#told = newest;
    if (last === null) return newest;
    const next = { take: last.take, index: last.index + 1 };
    if (told?.take === newest.take && told.index === newest.index) return next;
    const by = last.take === newest.take ? newest.index - last.index : Number.POSITIVE_INFINITY;
    return by >= -1 && by <= MISSED_MAX ? next : newest;
  }
}

/** The next part is requested this long before it is expected: the relay holds the request until it exists. */
const AHEAD_MS = 800;
/** An answer that took longer was held. */
const HELD_MS = 300;
/** The relay holds a request for at most 8 s. */
export const ANSWER_LIMIT_MS = 12_000;
/** If the next part does not arrive by then, the lane starts again with the newest. */
const LOST_MS = 10_000;
/** While more than this is waiting to be shown, nothing is requested. */
const ENOUGH_MS = 12_000;
const RETRY_MS = 1000;
const RETRY_MS_MAX = 30_000;
/** Retry interval while nothing is recorded yet: a robot may appear at any moment. */
const EMPTY_MS = 3000;
/** After a failure, the lane waits random(0 … this × 2^failures). */
const SPREAD_MS = 2000;
/** After this many failures the robot's state is in doubt, and after `FAILURES_MAX` the lane ends. */
const FAILURES_DOUBTED = 2;
const FAILURES_MAX = 4;
/** How many parts without a frame are skipped backwards to find a first pose. */
const BACK_MAX = 2;
/** How many frames may be played at once and still count as shown, because timers fire late. More means catching up. */
const SHOWN_MAX = 4;
const PACE_EVERY_MS = 1000;
/** Smaller changes of the page's delay are not reported. */
const BEHIND_STEP_MS = 250;

type Wanted =
  | { readonly what: 'beginning' }
  | { readonly what: 'part'; readonly name: PartName }
  | { readonly what: 'schema'; readonly sha256: string };

interface Waiting {
  readonly segment: Segment;
  readonly wasHeld: boolean;
  readonly agoMs: number | null;
  readonly atMs: number;
}

export interface LaneSettings {
  readonly robot: string;
  readonly view: string | null; // null: as the relay says
  readonly hz: number;
  readonly isVisible: boolean;
  readonly before: KnownBefore;
  /** In [0, 1). */
  readonly random: () => number;
  /** From the previous lane, if there was one. */
  readonly back?: LookBack;
}

/**
 * A robot's stream in parts (segments, wire/SPEC.md §10), read one after another over HTTP, so that caches can serve all viewers.
 * A pure state machine: times are ms of the viewer's clock, and each method returns the actions to perform. At most one request
 * is open, plus one more after events were missed.
 *
 * It first requests the lane's starting point, then the newest part, then each next part shortly before it is due. Any failure
 * leads back to the start after a random time, so that thousands of pages don't send requests at once.
 */
export class Lane {
  readonly #settings: LaneSettings;
  readonly #clock = new PlayClock();
  readonly #player: PartPlayer;
  readonly #pace = new RequestPace();
  readonly #end = new EndOfPast();
  readonly #meter = new RateMeter();
  #view: string | null;
  #delayMs = 0;
  #wanted: Wanted = { what: 'beginning' };
  #dueMs = 0;
  /** When the open request was sent; null: none is open. */
  #askedMs: number | null = null;
  /** The fastest answer so far. */
  #roundTripMs = Number.POSITIVE_INFINITY;
  #heardMs = 0;
  #failures = 0;
  #schema: string | null = null;
  /** Parts that wait for a prerequisite: a schema, or a part with a pose. In playing order. */
  #waiting: Waiting[] = [];
  #last: PartName | null = null;
  #wasToldNotYet = false;
  /** The additional request. */
  readonly #back: LookBack;
  #isOpen = false;
  #isOver = false;
  #toldBehindMs = Number.NaN;
  #toldPaceMs = Number.NEGATIVE_INFINITY;
  #actions: LaneAction[] = [];

  constructor(settings: LaneSettings) {
    const { view, isVisible, before, back, random } = settings;
    this.#settings = settings;
    this.#view = view;
    this.#back = back ?? new LookBack(random);
    const post = (message: FromStream) => this.#post(message);
    this.#player = new PartPlayer(this.#clock, isVisible, before, post, (missing, nowMs) => {
      this.#post({ kind: 'earlier', events: [], isAll: false });
      return this.#back.begin(missing, nowMs);
    });
  }

  start(nowMs: number): LaneAction[] {
    this.#heardMs = nowMs;
    this.#back.resume(nowMs);
    return this.tick(nowMs);
  }

  /** When `tick` must be called at the latest. */
  get nextMs(): number {
    const asksMs = this.#askedMs === null ? this.#dueMs : this.#askedMs + ANSWER_LIMIT_MS;
    return Math.min(this.#player.nextMs, asksMs, this.#back.nextMs);
  }

  /** Plays what is due, and requests what is due. */
  tick(nowMs: number): LaneAction[] {
    if (this.#isOver) return this.#take();
    if (this.#askedMs !== null && nowMs - this.#askedMs >= ANSWER_LIMIT_MS)
      this.#fail(nowMs, null, 'no answer');
    if (nowMs >= this.#back.heldMs) this.#letGo(this.#back.letGo());
    this.#clock.slew(nowMs);
    this.#play(nowMs);
    this.#ask(nowMs);
    this.#look(nowMs);
    return this.#take();
  }

  /** The open request was answered. `headMs`: when the answer's header arrived, viewer's clock. */
  answered(nowMs: number, answer: LaneAnswer, headMs = nowMs): LaneAction[] {
    if (this.#isOver || this.#askedMs === null) return [];
    const tookMs = headMs - this.#askedMs;
    this.#askedMs = null;
    this.#dueMs = nowMs;
    const { status, isJson } = answer;
    const wanted = this.#wanted;
    // without JSON, it is the answer of a proxy that people sign in to
    if (isJson && (status === 401 || status === 403))
      this.#finish(status + 4000, 'the relay shows it to others only');
    else if (status === 204 && wanted.what === 'part') this.#wait(nowMs, answer.retryMs);
    else if (status !== 200) this.#fail(nowMs, answer.retryMs, `answered ${status}`);
    else {
      this.#roundTripMs = Math.min(this.#roundTripMs, tookMs);
      if (wanted.what === 'part') this.#takePart(nowMs, wanted.name, answer, tookMs);
      else if (wanted.what === 'beginning') this.#begin(nowMs, answer);
      else this.#takeSchema(nowMs, wanted.sha256, answer);
    }
    return this.tick(nowMs);
  }

  /** The open request failed in transit. */
  failed(nowMs: number, reason: string): LaneAction[] {
    if (this.#isOver || this.#askedMs === null) return [];
    this.#fail(nowMs, null, reason);
    return this.tick(nowMs);
  }

  /** The additional request was answered; null: it failed in transit. */
  looked(nowMs: number, answer: LaneAnswer | null): LaneAction[] {
    const found = this.#isOver ? null : this.#back.take(nowMs, answer);
    if (found !== null) this.#tellFound(found);
    else if (!this.#isOver) this.#letGo(this.#back.letGo());
    return this.tick(nowMs);
  }

  visibility(nowMs: number, isVisible: boolean): LaneAction[] {
    this.#player.setVisible(isVisible);
    return this.tick(nowMs);
  }

  /** Something changed outside: the wait after a failure is cut short. */
  wake(nowMs: number): LaneAction[] {
    if (this.#failures > 0) this.#dueMs = Math.min(this.#dueMs, nowMs + SPREAD_MS * this.#settings.random());
    return this.tick(nowMs);
  }

  #take(): LaneAction[] {
    const actions = this.#actions;
    this.#actions = [];
    return actions;
  }

  #post(message: FromStream): void {
    this.#actions.push({ do: 'post', message });
  }

  #play(nowMs: number): void {
    const vouches = this.#failures < FAILURES_DOUBTED || nowMs < this.#player.endsMs;
    const frames = this.#player.play(nowMs, vouches);
    for (let count = Math.min(frames, SHOWN_MAX); count > 0; count--) this.#meter.recordArrival(nowMs);
    if (!this.#isOpen || nowMs - this.#toldPaceMs < PACE_EVERY_MS) return;
    this.#toldPaceMs = nowMs;
    this.#post({ kind: 'pace', hz: this.#meter.hz(nowMs), roundTripMs: null, lateMs: null });
    this.#tellBehind();
  }

  #look(nowMs: number): void {
    if (this.#isOver || !this.#isOpen) return;
    const page = this.#back.ask(nowMs);
    if (page !== null) this.#actions.push({ do: 'look', path: `/${this.#view}/${page}` });
  }

  /** Reports the events that were found: in order, if newer events have waited for them. */
  #tellFound(found: MissedEvents): void {
    const isAll = found.page === null;
    const isInTurn = Number.isFinite(this.#back.heldMs);
    if (isInTurn && isAll) {
      this.#back.letGo();
      this.#letGo(found);
    }
    this.#post({ kind: 'earlier', events: isInTurn ? [] : found.found, isAll });
  }

  #letGo(found: MissedEvents | null): void {
    this.#player.tellMissed((open) => found?.listWith(open) ?? []);
  }

  #tellBehind(): void {
    if (Number.isNaN(this.#clock.shiftMs)) return;
    const ms = Math.round(this.#clock.behindMs(this.#wayMs / 2) + this.#delayMs);
    if (Math.abs(ms - this.#toldBehindMs) < BEHIND_STEP_MS) return;
    this.#toldBehindMs = ms;
    this.#post({ kind: 'behind', ms });
  }

  /** The time that a request and its answer are in transit, if the request is not held; 0: unknown. */
  get #wayMs(): number {
    return Number.isFinite(this.#roundTripMs) ? this.#roundTripMs : 0;
  }

  #ask(nowMs: number): void {
    if (this.#isOver || this.#askedMs !== null) return;
    if (this.#wanted.what === 'part' && this.#player.endsMs - nowMs > ENOUGH_MS) {
      this.#dueMs = Math.max(this.#dueMs, this.#player.endsMs - ENOUGH_MS);
    }
    this.#dueMs = Math.max(this.#dueMs, this.#pace.whenFree(nowMs));
    if (nowMs < this.#dueMs) return;
    // after a sleep, the next part is long past
    if (this.#last !== null && this.#wanted.what === 'part' && nowMs - this.#heardMs > LOST_MS)
      this.#wanted = { what: 'beginning' };
    this.#askedMs = nowMs;
    this.#pace.recordRequest(nowMs);
    this.#actions.push({ do: 'ask', path: this.#pathOf(this.#wanted) });
  }

  #pathOf(wanted: Wanted): string {
    if (wanted.what === 'beginning') return this.#view === null ? '' : `?view=${this.#view}`;
    const below =
      wanted.what === 'part' ? `${wanted.name.take}/${wanted.name.index}` : `schema/${wanted.sha256}`;
    return `/${this.#view}/${below}`;
  }

  #begin(nowMs: number, answer: LaneAnswer): void {
    const beginning = readBeginning(answer);
    if (beginning === null) {
      this.#fail(nowMs, null, 'no description of a past');
      return;
    }
    if (!beginning.isKept) {
      this.#finish(1006, 'the relay keeps nothing that could be read in parts');
      return;
    }
    this.#recover(nowMs);
    this.#view = beginning.view;
    this.#delayMs = beginning.delayMs;
    const { newest } = beginning;
    if (newest === null) {
      this.#dueMs = nowMs + EMPTY_MS * (0.5 + this.#settings.random());
      this.#open();
      if (this.#last === null) this.#tellNothing(nowMs);
      return;
    }
    this.#wanted = { what: 'part', name: this.#end.goOn(this.#last, newest) };
  }

  #takePart(nowMs: number, name: PartName, answer: LaneAnswer, tookMs: number): void {
    if (answer.isJson) {
      const next = readNext(answer);
      if (next === null || (next.take === name.take && next.index <= name.index)) {
        this.#fail(nowMs, null, 'no name of a next part');
        return;
      }
      this.#recover(nowMs);
      this.#wanted = { what: 'part', name: next };
      return;
    }
    const segment = readPart(answer.bytes, { ...name, robot: this.#settings.robot, view: this.#view });
    if (segment === null) {
      this.#wanted = { what: 'part', name: { take: name.take, index: name.index + 1 } };
      this.#fail(nowMs, null, 'a damaged part', true);
      return;
    }
    this.#recover(nowMs);
    this.#pace.recordPart();
    // a viewer who joins is shown an existing part, however long a busy device takes for it
    const wasHeld = this.#last !== null && (this.#wasToldNotYet || tookMs > HELD_MS + this.#wayMs);
    this.#wasToldNotYet = false;
    const agoMs = answer.dateMs === null ? null : answer.dateMs - segment.toMs - this.#delayMs;
    this.#waiting.unshift({ segment, wasHeld, agoMs, atMs: nowMs });
    const hasPose = segment.records.some(({ kind }) => kind === 'frame');
    if (this.#last === null && !hasPose && name.index > 0 && this.#waiting.length <= BACK_MAX) {
      this.#wanted = { what: 'part', name: { take: name.take, index: name.index - 1 } };
      return;
    }
    this.#end.recordPart(wasHeld);
    this.#goOn(nowMs);
  }

  #takeSchema(nowMs: number, sha256: string, answer: LaneAnswer): void {
    const wrong = this.#player.addSchema(new TextDecoder().decode(answer.bytes));
    if (wrong !== null) this.#post({ kind: 'problem', problem: { what: 'schema', detail: wrong } });
    this.#recover(nowMs);
    this.#schema = sha256;
    this.#goOn(nowMs);
  }

  /** Passes the waiting parts to the player as soon as their schema has loaded. Then requests the next one. */
  #goOn(nowMs: number): void {
    let isOver = false;
    for (let first = this.#waiting[0]; first !== undefined; first = this.#waiting[0]) {
      const { segment, ...came } = first;
      const { start, toMs } = segment;
      if (start.schema !== null && start.schema !== this.#schema) {
        this.#wanted = { what: 'schema', sha256: start.schema };
        return;
      }
      this.#waiting.shift();
      const isNewTake = this.#last?.take !== start.take;
      const { shiftMs } = this.#clock;
      isOver = lastWordOf(segment) !== 'online';
      const anew = this.#clock.arrive({ fromMs: start.fromMs, toMs, ...came, isNewTake, isOver });
      this.#player.add(segment, anew && !Number.isNaN(shiftMs) ? shiftMs : null);
      this.#last = { take: start.take, index: start.index };
      this.#open();
      const dueMs = toMs + this.#clock.closeMs + this.#clock.spanMs - AHEAD_MS;
      this.#dueMs = this.#clock.isFound && this.#end.isNear ? Math.max(nowMs, dueMs) : nowMs;
    }
    const last = this.#last;
    if (last !== null) this.#wanted = { what: 'part', name: { take: last.take, index: last.index + 1 } };
    // a part from long ago, before a sleep: newer ones exist
    const isOld = nowMs - this.#player.endsMs > Math.max(LOST_MS, 2 * this.#clock.spanMs);
    if ((isOld && !isOver) || this.#end.isToBeAsked) this.#wanted = { what: 'beginning' };
    this.#tellBehind();
  }

  #open(): void {
    if (this.#isOpen) return;
    this.#isOpen = true;
    this.#actions.push({ do: 'open' });
    this.#post({ kind: 'rate', hz: this.#settings.hz, reason: null });
  }

  /** Nothing is recorded: the robot was not here within the relay's retention time. */
  #tellNothing(nowMs: number): void {
    const robot = { robot: 'offline', ageMs: null, seq: null } as const;
    this.#post({ kind: 'status', status: { ...robot, degraded: false, overShare: false, atMs: nowMs } });
  }

  #wait(nowMs: number, retryMs: number | null): void {
    this.#recover(nowMs);
    this.#wasToldNotYet = true;
    this.#end.recordNotYet();
    this.#dueMs = nowMs + Math.min(RETRY_MS_MAX, Math.max(RETRY_MS, retryMs ?? 0));
  }

  #recover(nowMs: number): void {
    this.#heardMs = nowMs;
    this.#failures = 0;
  }

  /** `goesOn`: the next part is known; otherwise the lane's starting point is requested. */
  #fail(nowMs: number, retryMs: number | null, reason: string, goesOn = false): void {
    this.#askedMs = null;
    this.#wasToldNotYet = false;
    this.#waiting = [];
    const spreadMs = SPREAD_MS * 2 ** this.#failures * this.#settings.random();
    this.#failures++;
    if (this.#failures >= FAILURES_MAX && !(nowMs < this.#player.endsMs)) {
      this.#finish(1006, reason);
      return;
    }
    if (!goesOn) this.#wanted = { what: 'beginning' };
    this.#dueMs = nowMs + Math.min(RETRY_MS_MAX, (retryMs ?? 0) + spreadMs);
  }

  #finish(code: number, reason: string): void {
    this.#isOver = true;
    this.#actions.push({ do: 'end', code, reason });
  }
}

/** Which part was requested. */
interface WantedPart extends PartName {
  readonly robot: string;
  readonly view: string | null;
}

/** The requested part; null if these bytes are not a part, or another one: a cache may have mixed them up. */
function readPart(bytes: Uint8Array, { robot, view, take, index }: WantedPart): Segment | null {
  try {
    const segment = decodeSegment(bytes);
    const { start } = segment;
    const isSame =
      start.robot === robot && start.view === view && start.take === take && start.index === index;
    return isSame ? segment : null;
  } catch (error) {
    if (error instanceof SegmentError) return null;
    throw error;
  }
}

/** The robot's state at the end of a part. */
function lastWordOf({ start, records }: Segment): RobotStatus {
  const last = records.findLast((record) => record.kind === 'word');
  return last?.kind === 'word' ? last.word : start.word;
}

/** The actions of a lane. `do: 'end'`: the lane has ended, with a code from the close table (wire/SPEC.md). */
export type LaneAction =
  /** Request this, below the address of the robot's past. Cancels an earlier request that is still open. */
  | { readonly do: 'ask'; readonly path: string }
  /** Send this additional request. Cancels an earlier one. */
  | { readonly do: 'look'; readonly path: string }
  | { readonly do: 'post'; readonly message: FromStream }
  /** The relay has answered: the stream is open. */
  | { readonly do: 'open' }
  | { readonly do: 'end'; readonly code: number; readonly reason: string };
