import {
  type EventMessage,
  parseRelayMessage,
  type RobotStatus,
  type Segment,
  type SegmentRecord,
  type SegmentStart,
} from '@posecast/wire';
import { causeOf } from '../../twin/names.ts';
import { type EventMark, FAULTS_MAX, type KnownBefore, ToldFaults } from '../lane_port.ts';
import type { FromStream } from '../messages.ts';
import type { Missing } from './missed_events.ts';
import type { PlayClock } from './play_clock.ts';
import { PoseReader } from './pose_reader.ts';

const N_STEP = 2 ** -20;

/** End events for faults of `told` that began before a moment (unix ms) and are no longer open, if their end was missed. `open`:
 *  all open faults; `n`: the newest event's number. The end events get numbers between that one and the next. */
function missedEnds(
  told: readonly EventMessage[],
  open: readonly EventMessage[],
  atMs: number,
  n: number,
): EventMessage[] {
  if (open.length >= FAULTS_MAX) return [];
  const causes = new Set(open.map(causeOf));
  return told
    .filter((event) => event.at !== null && 1000 * event.at < atMs && !causes.has(causeOf(event)))
    .map((event, i) => ({ ...event, n: n + (i + 1) * N_STEP, at: atMs / 1000, state: 'off' }));
}

/** Selects the events that the page does not have yet. The page takes a number that goes back in time to mean that the relay lost
 *  count, so an old event must not be repeated. */
class ToldEvents {
  #newest: EventMark | null;

  /** `newest`: the newest event that the page already has. */
  constructor(newest: EventMark | null) {
    this.#newest = newest;
  }

  /** The time of the newest known event, unix ms; 0: none. */
  get newestMs(): number {
    return 1000 * (this.#newest?.at ?? 0);
  }

  /** The event, unless it is known or older than the known ones. */
  take(event: EventMessage): EventMessage | null {
    const newest = this.#newest;
    if (newest !== null) {
      const [at, before] = [event.at ?? 0, newest.at ?? 0];
      if (at < before || (at === before && event.n <= newest.n)) return null;
    }
    this.#newest = event;
    return event;
  }
}

/** An event given as text in a part; null if it is invalid. */
function eventOf(text: string): EventMessage | null {
  const event = parseRelayMessage(text);
  return event?.type === 'event' ? event : null;
}

/** Data that arrived longer ago than this was held up on this device: it gets the current time. */
const HELD_UP_MS = 50;
/** The maximum number of waiting parts; only reached if the device sleeps. The oldest are then played at once. */
const PARTS_MAX = 4;
const STATUS_EVERY_MS = 500;

interface Part {
  readonly segment: Segment;
  /** The next record to play; -1: the start of the part. */
  next: number;
  /** The clock's shift for this part, if the clock has restarted since; null: the current one. */
  shiftMs: number | null;
}

/** Plays parts one after another: each record at its time, in the order in which the relay accepted them. */
export class PartPlayer {
  readonly #clock: PlayClock;
  readonly #post: (message: FromStream) => void;
  readonly #poses: PoseReader;
  readonly #events: ToldEvents;
  readonly #faults = new ToldFaults();
  readonly #missed: (missing: Missing, nowMs: number) => boolean;
  /** Events that wait for the missed ones; null: none are missing. */
  #held: (() => void)[] | null = null;
  /** The faults that were open at the start of the first part after the gap. */
  #heldFaults: readonly EventMessage[] = [];
  #parts: Part[] = [];
  #isVisible: boolean;
  #word: RobotStatus = 'offline';
  #lastFrame: { readonly seq: number; readonly bornMs: number } | null = null;
  #infoText = '';
  #model: string | null | undefined;
  #hasBegun = false;
  #take = '';
  /** The newest event of the played parts, and the newest that the page has received. */
  #eventN = 0;
  #toldN: number;
  /** When everything loaded has been shown, viewer's clock; relative to the last part if none waits. */
  #endsMs = Number.NaN;
  #statusMs = Number.NEGATIVE_INFINITY;

  /** `missed`: called when events are missing. Returns whether `tellMissed` will be called with them; newer events wait until
   *  then. */
  constructor(
    clock: PlayClock,
    isVisible: boolean,
    before: KnownBefore,
    post: (message: FromStream) => void,
    missed: (missing: Missing, nowMs: number) => boolean,
  ) {
    this.#clock = clock;
    this.#isVisible = isVisible;
    this.#poses = new PoseReader(before.frame);
    this.#events = new ToldEvents(before.event);
    for (const event of before.faults) this.#faults.record(event);
    this.#toldN = before.event?.n ?? 0;
    this.#post = post;
    this.#missed = missed;
  }

  /** Takes a schema's text. Returns what is wrong with it; null: nothing. */
  addSchema(text: string): string | null {
    return this.#poses.addSchema(text);
  }

  /** Takes the next part. `shiftMs`: the clock's previous shift, if the clock has restarted with this part; else null. */
  add(segment: Segment, shiftMs: number | null): void {
    if (shiftMs !== null) for (const part of this.#parts) part.shiftMs ??= shiftMs;
    this.#parts.push({ segment, next: -1, shiftMs: null });
  }

  /** When the next record is due, or everything has been shown, viewer's clock. */
  get nextMs(): number {
    const [part] = this.#parts;
    return part === undefined ? Number.POSITIVE_INFINITY : this.#dueMs(part);
  }

  /** When everything loaded has been shown, viewer's clock; NaN before the first part. */
  get endsMs(): number {
    const part = this.#parts.at(-1);
    return part === undefined ? this.#endsMs : part.segment.toMs + this.#shiftOf(part);
  }

  get word(): RobotStatus {
    return this.#word;
  }

  /** Plays what is due. Of several frames, only the newest is shown. `vouches`: the relay answers, so the robot's state is still
   *  valid. Returns how many frames there were. */
  play(nowMs: number, vouches: boolean): number {
    const wordBefore = this.#word;
    let frames = 0;
    for (let part = this.#parts[0]; part !== undefined; part = this.#parts[0]) {
      const isSurplus = this.#parts.length > PARTS_MAX;
      if (!isSurplus && this.#dueMs(part) > nowMs) break;
      const record = part.segment.records[part.next];
      if (part.next < 0) this.#begin(part, nowMs);
      else if (record === undefined) {
        this.#endsMs = part.segment.toMs + this.#shiftOf(part);
        this.#parts.shift();
        continue;
      } else frames += this.#play(part, record, nowMs);
      part.next++;
    }
    if (this.#isVisible) this.#poses.post(this.#post);
    const isDue = nowMs - this.#statusMs >= STATUS_EVERY_MS || this.#word !== wordBefore;
    if (this.#hasBegun && vouches && isDue) this.#tellStatus(nowMs);
    return frames;
  }

  /** Reports the missed events, and then those that have waited for them. `list`: all of them, and the faults that were open
   *  after them. */
  tellMissed(list: (open: readonly EventMessage[]) => readonly EventMessage[]): void {
    const held = this.#held ?? [];
    this.#held = null;
    for (const event of list(this.#heldFaults)) this.#tellEvent(event);
    for (const tell of held) tell();
  }

  /** A hidden page gets no poses. */
  setVisible(isVisible: boolean): void {
    this.#isVisible = isVisible;
    this.#statusMs = Number.NEGATIVE_INFINITY; // reported at once
  }

  #dueMs(part: Part): number {
    const { segment, next } = part;
    const record = segment.records[next];
    const atMs =
      next < 0 ? segment.start.fromMs : record === undefined ? segment.toMs : timeOf(segment, record);
    return atMs + this.#shiftOf(part);
  }

  #shiftOf(part: Part): number {
    return part.shiftMs ?? this.#clock.shiftMs;
  }

  /** The robot's state at the start of a part: reported if it is new. Open faults are reported if earlier parts are missing. */
  #begin({ segment: { start } }: Part, nowMs: number): void {
    this.#word = start.word;
    this.#tellModel(start.model);
    this.#tellInfo(start.info);
    const isMissing = start.eventN !== this.#eventN;
    if (!this.#hasBegun || start.take !== this.#take || isMissing) {
      if (isMissing) this.#lookBack(start, nowMs);
      this.#inTurn(() => this.#settleFaults(start));
    }
    this.#take = start.take;
    this.#eventN = start.eventN;
    this.#hasBegun = true;
  }

  /** Events are missing: newer ones wait, if the missing ones are being searched for. */
  #lookBack({ fromMs, eventN, openFaults }: SegmentStart, nowMs: number): void {
    const toldN = Math.floor(this.#toldN);
    const isCountedAnew = eventN < toldN;
    const isSought =
      this.#held === null &&
      eventN !== toldN &&
      this.#events.newestMs < fromMs &&
      this.#missed({ fromMs, eventN, toldN: isCountedAnew ? 0 : toldN }, nowMs);
    if (!isSought) return;
    this.#held = [];
    this.#heldFaults = openFaults.map(eventOf).filter((event) => event !== null);
  }

  #inTurn(tell: () => void): void {
    if (this.#held === null) tell();
    else this.#held.push(tell);
  }

  /** Earlier parts are missing: ends the faults that ended in them, and reports those that began in them. */
  #settleFaults({ openFaults, eventN, fromMs }: SegmentStart): void {
    const open = openFaults.map(eventOf).filter((event) => event !== null);
    const isCountedAnew = eventN < Math.floor(this.#toldN);
    const n = isCountedAnew ? 0 : this.#toldN;
    for (const end of missedEnds(this.#faults.open, open, fromMs, n)) this.#postEvent(end);
    for (const event of open) this.#tellEvent(event);
  }

  /** Plays a record. Returns how many frames to show it contains. */
  #play(part: Part, record: SegmentRecord, nowMs: number): number {
    const { segment } = part;
    switch (record.kind) {
      case 'frame': {
        const acceptedMs = timeOf(segment, record);
        const dueMs = acceptedMs + this.#shiftOf(part);
        const atMs = nowMs - dueMs > HELD_UP_MS ? nowMs : dueMs;
        const lateMs = record.lateUs / 1000 + (atMs - dueMs);
        const liveMs = acceptedMs + this.#clock.closeMs;
        const frame = { bytes: record.frame, runId: segment.start.runId, acceptedMs, liveMs, atMs, lateMs };
        this.#lastFrame = { seq: record.seq, bornMs: atMs - lateMs };
        return this.#poses.addFrame(frame, this.#clock.isFound) ? 1 : 0;
      }
      case 'copy':
        this.#poses.addCopy(record.frame);
        return 0;
      case 'event': {
        const event = eventOf(record.text);
        if (event === null) return 0;
        this.#eventN = event.n;
        this.#inTurn(() => this.#tellEvent(event));
        return 0;
      }
      case 'info':
        this.#tellInfo(record.info);
        return 0;
      case 'model':
        this.#tellModel(record.model);
        return 0;
      case 'word':
        this.#word = record.word;
        return 0;
    }
  }

  #tellEvent(event: EventMessage): void {
    if (this.#events.take(event) !== null) this.#postEvent(event);
  }

  #postEvent(event: EventMessage): void {
    this.#toldN = event.n;
    this.#faults.record(event);
    this.#post({ kind: 'event', event });
  }

  #tellModel(hash: string | null): void {
    if (this.#model === hash) return;
    this.#model = hash;
    this.#post({ kind: 'model', hash });
  }

  #tellInfo(kv: ReadonlyMap<string, string>): void {
    const text = JSON.stringify([...kv]);
    if (this.#infoText === text || (this.#infoText === '' && kv.size === 0)) return;
    this.#infoText = text;
    this.#post({ kind: 'info', kv });
  }

  #tellStatus(nowMs: number): void {
    this.#statusMs = nowMs;
    const last = this.#lastFrame;
    const ageMs = last === null ? null : Math.max(0, nowMs - last.bornMs);
    const robot = { robot: this.#word, ageMs, seq: last?.seq ?? null };
    this.#post({
      kind: 'status',
      status: { ...robot, degraded: false, overShare: false, atMs: nowMs, endsMs: this.endsMs },
    });
  }
}

/** When the relay accepted a record, unix ms. */
function timeOf({ start }: Segment, { atUs }: SegmentRecord): number {
  return start.fromMs + atUs / 1000;
}
