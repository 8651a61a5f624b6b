import type { EventMessage, RobotStatus, Schema } from '@posecast/wire';
import { dropOldest, firstPlace, isWithin } from '../../../kit.ts';
import type { RobotState } from '../../../twin/robot.ts';
import type { Span } from '../../past_types.ts';
import { type Change, type Happening, nameOf, type Situation, situationAfter } from './happenings.ts';
import type { TapeFrame } from './tape.ts';

/** How far back it goes, ms. */
const OWN_MS = 60_000;
/** Limit for the codes and for the happenings; the oldest are dropped. */
export const OWN_BYTES_MAX = 8e6;
const HAPPENINGS_MAX = 2000;
/** The relay's newest moment is at most this far behind the data received here, and at most `AHEAD_MS` ahead of it. Otherwise the
 *  clocks differ. */
const BEHIND_MS = 90_000;
const AHEAD_MS = 3000;
/** A measured clock difference is kept unless it changes by more than this, so that moments don't jitter. */
const STEADY_MS = 100;

/** The result of matching the page's frames with a segment. */
export interface Alignment {
  /** Their previous run id. */
  readonly formerRun: string;
  readonly runId: string;
  /** The shift of their moments, ms. */
  readonly byMs: number;
}

/** Frames with increasing numbers. `runId` is a name of our own until a segment reveals the real one. */
interface OwnRun {
  runId: string;
  isKnown: boolean;
}

type OwnFrame = Omit<TapeFrame, 'runId'> & { readonly run: OwnRun };

/**
 * The last minute that the page itself received, within `OWN_BYTES_MAX`. Times are given by the page's clock and returned by the
 * relay's, as far as the difference is known.
 */
export class OwnTape {
  #frames: OwnFrame[] = [];
  #happenings: (Change & { readonly atMs: number })[] = [];
  #before: Situation = { model: null, info: new Map(), word: null, faults: [] };
  #now = this.#before;
  #bytes = 0;
  #runs = 0;
  /** Add it to the page's clock to get the relay's. */
  #offsetMs = 0;
  #isMeasured = false;
  readonly #events = new Set<string>();

  /** The delay of the newest state, ms. */
  behindMs = 0;

  /** Adds a state of the live stream, with its delay. Its codes are copied. */
  push(schema: Schema, state: RobotState, behindMs = 0): void {
    if (state.schemaId !== schema.id) return;
    this.behindMs = behindMs;
    const { seq, tS } = state;
    const before = this.#frames.at(-1);
    const rises = before !== undefined && before.schemaId === schema.id && ((seq - before.seq) | 0) > 0;
    if (!rises && this.#frames.some((known) => known.seq === seq && known.tS === tS)) return;
    const run = rises ? before.run : { runId: `own ${++this.#runs}`, isKnown: false };
    const atMs = Math.max(state.atMs - (state.lateMs ?? 0) - behindMs, before?.atMs ?? 0);
    const codes = state.codes.slice(0, schema.size);
    this.#frames.push({ run, schema, schemaId: schema.id, seq, tS, codes, atMs, lateMs: 0 });
    this.#bytes += codes.byteLength;
    this.#trim(atMs);
  }

  /** Adds an event. The relay repeats the newest events at every join, so known ones are dropped. */
  event(event: EventMessage, atMs: number): void {
    const name = nameOf(event);
    if (this.#events.has(name)) return;
    this.#events.add(name);
    dropOldest(this.#events, HAPPENINGS_MAX);
    this.#change({ kind: 'event', event }, atMs);
  }

  model(model: string | null, atMs: number): void {
    if (model !== this.#now.model) this.#change({ kind: 'model', model }, atMs);
  }

  info(info: ReadonlyMap<string, string>, atMs: number): void {
    this.#change({ kind: 'info', info }, atMs);
  }

  word(word: RobotStatus, atMs: number): void {
    if (word !== this.#now.word) this.#change({ kind: 'word', word }, atMs);
  }

  /** Takes the newest moment of the relay's past, which is used to compare the clocks until they are measured. */
  guess(newestMs: number): void {
    const own = this.#frames.at(-1)?.atMs;
    if (this.#isMeasured || own === undefined) return;
    const aheadMs = newestMs - own;
    this.#offsetMs = aheadMs > AHEAD_MS || aheadMs < -BEHIND_MS ? aheadMs : 0;
  }

  /** Takes the run and the relay's times of frames from a segment. Null if it contains none of them, or if nothing is new. */
  align(frames: readonly TapeFrame[]): Alignment | null {
    const bySeq = new Map(frames.map((frame) => [frame.seq, frame]));
    const offsetsMs: number[] = [];
    let run: OwnRun | null = null;
    for (const own of this.#frames) {
      const frame = bySeq.get(own.seq);
      if (frame === undefined || (own.run.isKnown && own.run.runId !== frame.runId)) continue;
      if (!isSame(own, frame)) continue;
      offsetsMs.push(frame.atMs - own.atMs);
      run = own.run;
    }
    if (run === null) return null;
    const medianMs = offsetsMs.sort((a, b) => a - b)[offsetsMs.length >> 1]!;
    const isSteady = this.#isMeasured && Math.abs(medianMs - this.#offsetMs) < STEADY_MS;
    const byMs = isSteady ? 0 : medianMs - this.#offsetMs;
    this.#offsetMs += byMs;
    this.#isMeasured = true;
    const { runId: formerRun, isKnown } = run;
    if (isKnown && isSteady) return null;
    run.runId = frames[0]!.runId;
    run.isKnown = true;
    return { formerRun, runId: run.runId, byMs };
  }

  /** The newest; null if there is none. */
  get newest(): TapeFrame | null {
    return this.#given(this.#frames.length - 1);
  }

  /** The newest at or before a moment. */
  at(momentMs: number): TapeFrame | null {
    return this.#given(firstPlace(this.#frames, ({ atMs }) => atMs + this.#offsetMs > momentMs) - 1);
  }

  /** The first for which `is` holds; it must hold for all later ones too. */
  firstWhere(is: (frame: TapeFrame) => boolean): TapeFrame | null {
    return this.#given(this.#placeWhere(is));
  }

  /** The last for which `is` does not hold; the same condition applies. */
  lastUnless(is: (frame: TapeFrame) => boolean): TapeFrame | null {
    return this.#given(this.#placeWhere(is) - 1);
  }

  /** All from a moment on, oldest first. */
  since(momentMs: number): TapeFrame[] {
    const place = this.#placeWhere(({ atMs }) => atMs >= momentMs);
    return this.#frames.slice(place).map((own) => given(own, this.#offsetMs));
  }

  /** Happenings after one moment and up to another. */
  happenings(afterMs: number, untilMs: number): Happening[] {
    return this.#happenings
      .map((each) => ({ ...each, atMs: each.atMs + this.#offsetMs, place: 0 }))
      .filter(({ atMs }) => atMs > afterMs && atMs <= untilMs);
  }

  situationAt(momentMs: number): Situation {
    return situationAfter(this.#before, this.happenings(Number.NEGATIVE_INFINITY, momentMs));
  }

  /** Drops what lies in these spans, by the relay's clock. */
  forget(spans: readonly Span[]): void {
    const isLeft = ({ atMs }: { readonly atMs: number }) => !isWithin(atMs + this.#offsetMs, spans);
    this.#frames = this.#frames.filter(isLeft);
    this.#happenings = this.#happenings.filter(isLeft);
    this.#bytes = this.#frames.reduce((sum, { codes }) => sum + codes.byteLength, 0);
  }

  /** Size of the codes. */
  get bytes(): number {
    return this.#bytes;
  }

  #placeWhere(is: (frame: TapeFrame) => boolean): number {
    return firstPlace(this.#frames, (own) => is(given(own, this.#offsetMs)));
  }

  #given(place: number): TapeFrame | null {
    const own = this.#frames[place];
    return own === undefined ? null : given(own, this.#offsetMs);
  }

  #change(change: Change, atMs: number): void {
    this.#now = situationAfter(this.#now, [change]);
    this.#happenings.push({ ...change, atMs: Math.max(atMs, this.#happenings.at(-1)?.atMs ?? 0) });
    this.#trim(atMs);
  }

  #trim(nowMs: number): void {
    const frames = this.#frames;
    while (frames.length > 1 && (frames[0]!.atMs < nowMs - OWN_MS || this.#bytes > OWN_BYTES_MAX))
      this.#bytes -= frames.shift()!.codes.byteLength;
    const sinceMs = Math.max(nowMs - OWN_MS, frames[0]?.atMs ?? 0);
    const old = firstPlace(this.#happenings, ({ atMs }) => atMs >= sinceMs);
    const dropped = this.#happenings.splice(0, Math.max(old, this.#happenings.length - HAPPENINGS_MAX));
    if (dropped.length > 0) this.#before = situationAfter(this.#before, dropped);
  }
}

/** Numbers restart with each run, so everything in a frame must match. */
function isSame(own: OwnFrame, frame: TapeFrame): boolean {
  if (own.schemaId !== frame.schemaId || Math.abs(own.tS - frame.tS) > 1e-3) return false;
  return own.codes.every((code, i) => code === frame.codes[i]);
}

function given({ run, ...own }: OwnFrame, offsetMs: number): TapeFrame {
  return { ...own, runId: run.runId, atMs: own.atMs + offsetMs };
}
