import { firstPlace } from '../../../kit.ts';
import { nameOfRef, type PastSource, type SegmentRef } from '../../past_source.ts';
import { PAGE_MS, type Span } from '../../past_types.ts';
import type { Situation } from './happenings.ts';
import { type LoadState, type Loads, nameOfDay } from './loads.ts';
import type { Alignment, OwnTape } from './own_tape.ts';
import { newestAt, TAPE_BYTES_MAX, type Tape, type TapeFrame, type TapePart } from './tape.ts';

/** Maximum clock difference between two recorders of one robot, ms, for merging their frames. */
export const APART_MS = 1000;
/** Longer than any segment, ms. */
const SEGMENT_MS = 10_000;
/** How long to wait for data before using the page's own frames instead, ms. */
export const PATIENCE_MS = 300;
/** Own frames that are older than this at a moment don't count as its state, ms. */
const OWN_APART_MS = 1500;

/** Maximum number of loads started at once: a robot rarely has more than one segment per recorder at a moment. */
export const LOADS_MAX = 8;

/** Maximum number of segments looked at for each picture; the others of so many in a few seconds are not shown. */
const NEAR_MAX = 3000;
/** Maximum number of segments read around a moment, for plots and whatever else needs its surroundings. */
export const AROUND_MAX = 500;

/** Data that may contain frames and is not loaded: a segment, ten minutes of the index, or a day (`take` is empty for the latter
 *  two). */
export interface Pending extends Span {
  readonly take: string;
  readonly index: number;
  readonly state: LoadState;
  /** The page's own frames can replace it. */
  readonly isReplaceable: boolean;
  begin(): void;
}

/** The content of a span. */
export interface Near {
  readonly parts: readonly TapePart[];
  readonly pending: readonly Pending[];
  /** Segments that are corrupt. */
  readonly damaged: readonly SegmentRef[];
}

/** A frame with its segment and its position there; `part` is null for the page's own frames. */
export interface Next {
  readonly frame: TapeFrame;
  readonly part: TapePart | null;
  readonly place: number;
}

/** What to show at a moment. `pending`: data that must be loaded first or, if there is a frame, data that would improve it. */
export interface Shown {
  readonly frame: TapeFrame | null;
  readonly situation: Situation | null;
  readonly pending: readonly Pending[];
  /** A segment at that moment is corrupt. */
  readonly isDamaged: boolean;
}

/** Reads segments and the page's own frames as one sequence: by run, then by number, each frame once. */
export class Reel {
  /** Segments known to be lost: `count` with frames from a moment on, namely all that begin before `sinceMs`, and the first `skip`
   *  of those that reach `sinceMs`. */
  #lost: {
    readonly timeline: PastSource['timeline'];
    readonly momentMs: number;
    sinceMs: number;
    skip: number;
    count: number;
  } | null = null;

  constructor(
    private readonly source: PastSource,
    private readonly tape: Tape,
    private readonly own: OwnTape,
    private readonly loads: Loads,
    private readonly onAlign: (alignment: Alignment) => void,
  ) {}

  /** The known content of a span. */
  near(span: Span): Near {
    const { fromMs, toMs } = span;
    const refs = this.source.segmentsIn(span, NEAR_MAX);
    return this.#sort(refs, this.#pages({ fromMs: fromMs - SEGMENT_MS, toMs }));
  }

  /** The loaded frames of a segment. */
  framesOf(ref: SegmentRef): readonly TapeFrame[] {
    const part = this.tape.get(ref);
    return part === null ? [] : this.#open(part).frames;
  }

  /** The first frame after `cursor`, or without one the first at or after the moment. */
  next({ parts }: Near, cursor: TapeFrame | null, momentMs: number): Next | null {
    const isNext = (frame: TapeFrame): boolean =>
      cursor === null ? frame.atMs >= momentMs : this.tape.order(frame, cursor) > 0;
    let best: Next | null = null;
    for (const part of parts) {
      const place = firstPlace(part.frames, isNext);
      const frame = part.frames[place];
      if (frame !== undefined && (best === null || this.tape.order(frame, best.frame) < 0))
        best = { frame, part, place };
    }
    const own = this.own.firstWhere(isNext);
    if (own === null || (best !== null && this.tape.order(own, best.frame) >= 0)) return best;
    return { frame: own, part: null, place: 0 };
  }

  /** Data that must be loaded before a frame is shown, or before anything is shown if there is no frame. */
  blockers({ pending }: Near, next: Next | null, momentMs: number): Pending[] {
    return pending.filter(({ fromMs, toMs, take, index, isReplaceable }) => {
      if (toMs + 1 <= momentMs) return false; // it is rounded down
      if (next === null) return true;
      const { frame, part } = next;
      if (part !== null && take === part.ref.take) return index < part.ref.index;
      if (part === null && isReplaceable && frame.atMs - momentMs <= APART_MS) return false;
      return fromMs - APART_MS <= frame.atMs;
    });
  }

  /** The moment of the next frame or happening, exact or from the index; null if none is known. */
  nextMs(cursor: TapeFrame | null, momentMs: number): number | null {
    const near = this.near({ fromMs: momentMs - APART_MS, toMs: momentMs + SEGMENT_MS });
    let nextMs = Number.POSITIVE_INFINITY;
    const add = (atMs = nextMs): void => {
      if (atMs > momentMs) nextMs = Math.min(nextMs, atMs);
    };
    add(this.next(near, cursor, momentMs)?.frame.atMs);
    for (const { happenings } of near.parts) for (const { atMs } of happenings) add(atMs);
    for (const ref of this.#each({ fromMs: momentMs, toMs: momentMs + PAGE_MS }))
      if (ref.fromMs > momentMs && !this.#isLost(ref)) {
        add(ref.fromMs);
        break;
      }
    const movement = this.source.timeline?.movement ?? [];
    add(movement[firstPlace(movement, ({ fromMs }) => fromMs > momentMs)]?.fromMs);
    return Number.isFinite(nextMs) ? nextMs : null;
  }

  /** The segments to be played next: the requested number from each take, but at most `most` in all, using at most half of the
   *  size limit. */
  ahead(momentMs: number, count: number, most: number): SegmentRef[] {
    const takes = new Map<string, number>();
    const found: SegmentRef[] = [];
    let bytes = 0;
    const span = { fromMs: momentMs, toMs: momentMs + PAGE_MS / 10 };
    for (const ref of this.source.segmentsIn(span, AROUND_MAX)) {
      const nth = takes.get(ref.take) ?? 0;
      takes.set(ref.take, nth + 1);
      const size = ref.schema === null ? 0 : (this.loads.knownReader(ref.schema)?.schema.size ?? 0);
      bytes += ref.bytes + 4 * size * ref.frames;
      const fits = nth <= count && (nth === 0 || bytes <= TAPE_BYTES_MAX / 2);
      if (fits && !this.#isLost(ref)) found.push(ref);
      if (found.length >= most) break;
    }
    return found;
  }

  /** The newest state at or before a moment, else the first one after it. */
  at(momentMs: number): Shown {
    const { refs, pages } = this.#upTo(momentMs);
    const near = this.#sort(refs, pages);
    const { parts, pending } = near;
    const isDamaged = this.near({ fromMs: momentMs, toMs: momentMs }).damaged.length > 0;
    const own = this.own.at(momentMs);
    if (pending.length > 0) {
      const isHere = own !== null && momentMs - own.atMs <= OWN_APART_MS;
      return {
        frame: isHere ? own : null,
        situation: isHere ? this.own.situationAt(momentMs) : null,
        pending,
        isDamaged,
      };
    }
    let frame = own;
    for (const part of parts) frame = this.tape.last(frame, newestAt(part.frames, momentMs));
    if (frame === null) {
      const next = this.next(near, null, momentMs);
      frame = next?.frame ?? null;
    }
    const shownMs = Math.max(momentMs, frame?.atMs ?? 0);
    const part = parts.filter(({ ref }) => ref.fromMs <= shownMs).at(-1);
    const isOwn = part === undefined || (frame === own && frame !== null && frame.atMs > part.ref.toMs);
    const situation = isOwn ? this.own.situationAt(shownMs) : part.situationAt(shownMs);
    return { frame, situation, pending, isDamaged };
  }

  /** The frame before one. */
  before(cursor: TapeFrame): Omit<Shown, 'situation' | 'isDamaged'> {
    const isBehind = (frame: TapeFrame): boolean => this.tape.order(frame, cursor) >= 0;
    const own = this.own.lastUnless(isBehind);
    for (let momentMs = cursor.atMs - 1e-3; ; ) {
      const { refs, pages } = this.#upTo(momentMs);
      const { parts, pending } = this.#sort(refs, pages);
      if (pending.some(({ isReplaceable }) => !isReplaceable || own === null))
        return { frame: null, pending };
      let frame = own;
      for (const part of parts)
        frame = this.tape.last(frame, part.frames[firstPlace(part.frames, isBehind) - 1] ?? null);
      const earliestMs = refs.reduce((least, { fromMs }) => Math.min(least, fromMs), momentMs) - 1e-3;
      if (frame !== null || !(earliestMs < momentMs)) return { frame, pending: [] };
      momentMs = earliestMs;
    }
  }

  /** The segments and index pages that determine the state at a moment. */
  #upTo(momentMs: number): { refs: SegmentRef[]; pages: Pending[] } {
    const movement = this.source.timeline?.movement ?? [];
    const moved = movement[firstPlace(movement, ({ fromMs }) => fromMs > momentMs) - 1];
    const unknown = this.unknownBefore(momentMs, moved?.toMs ?? Number.NEGATIVE_INFINITY);
    const backMs = unknown === null ? Math.min(momentMs, moved?.toMs ?? momentMs) : momentMs;
    const pages = [
      ...this.#pages({ fromMs: backMs - SEGMENT_MS, toMs: backMs }),
      ...this.#pages({ fromMs: momentMs, toMs: momentMs }),
    ];
    const kept = (span: Span): SegmentRef[] =>
      this.source.segmentsIn(span, NEAR_MAX).filter((ref) => !this.#isLost(ref));
    const nearMs = backMs - 2 * APART_MS;
    let refs = kept({ fromMs: nearMs, toMs: momentMs });
    let endMs = endOf(refs);
    if (endMs < nearMs + APART_MS) {
      refs = kept({ fromMs: backMs - 7 * SEGMENT_MS, toMs: momentMs });
      endMs = endOf(refs);
    }
    if (Number.isFinite(endMs)) {
      const sinceMs = Math.min(momentMs, endMs) - APART_MS;
      return { refs: refs.filter(({ toMs }) => toMs >= sinceMs), pages };
    }
    if (unknown !== null) return { refs, pages: [...pages, this.dayOf(unknown)] };
    return { refs: [...refs, ...this.#firstAfter(momentMs)], pages };
  }

  /** The segments of a span after the first `skip`, for whoever needs only some of them. */
  *#each(span: Span, skip = 0): Generator<SegmentRef> {
    let given = skip;
    for (let most = skip + 32; ; most *= 4) {
      const refs = this.source.segmentsIn(span, most);
      for (; given < refs.length; given += 1) yield refs[given]!;
      if (refs.length < most) return;
    }
  }

  /** The first segments with frames from a moment on: one, or where some are lost, as many as are likely to contain one that is
   *  not. Those known to be lost are not looked at again, however many there are. */
  #firstAfter(momentMs: number): SegmentRef[] {
    const { timeline } = this.source;
    if (this.#lost?.timeline !== timeline || this.#lost.momentMs !== momentMs)
      this.#lost = { timeline, momentMs, sinceMs: momentMs, skip: 0, count: 0 };
    const lost = this.#lost;
    const { sinceMs } = lost;
    const found: SegmentRef[] = [];
    let place = lost.skip;
    for (const ref of this.#each({ fromMs: sinceMs, toMs: momentMs + PAGE_MS }, place)) {
      place += 1;
      if (ref.frames === 0 || ref.fromMs < sinceMs) continue;
      if (!this.#isLost(ref)) found.push(ref);
      else if (found.length === 0) {
        lost.count += 1;
        lost.sinceMs = ref.fromMs;
        lost.skip = ref.fromMs === sinceMs ? place : 0;
      }
      if (found.length > Math.min(lost.count, LOADS_MAX - 1)) break;
    }
    return found;
  }

  /** The newest unknown day before a moment and back to `sinceMs`; null if there is none. */
  unknownBefore(momentMs: number, sinceMs: number): Span | null {
    return this.#unknown(sinceMs, momentMs).at(-1) ?? null;
  }

  /** The oldest unknown day after a moment and up to `untilMs`; null if there is none. */
  unknownAfter(momentMs: number, untilMs: number): Span | null {
    return this.#unknown(momentMs, untilMs)[0] ?? null;
  }

  /** The unknown days in a span, except unavailable ones: there the known data must do. */
  #unknown(fromMs: number, toMs: number): readonly Span[] {
    const days = this.source.timeline?.unknown ?? [];
    const isLost = (day: Span) => ['gone', 'damaged'].includes(this.loads.stateOf(nameOfDay(day.fromMs)));
    return days.filter((day) => day.toMs > fromMs && day.fromMs < toMs && !isLost(day));
  }

  /** A day that has not been fetched yet. */
  dayOf({ fromMs, toMs }: Span): Pending {
    const span = { fromMs, toMs, take: '', index: 0 };
    return this.#pending(span, nameOfDay(fromMs), () => void this.loads.day(fromMs));
  }

  #sort(refs: readonly SegmentRef[], pages: readonly Pending[]): Near {
    const parts: TapePart[] = [];
    const pending = [...pages];
    const damaged: SegmentRef[] = [];
    for (const ref of refs) {
      if (ref.frames > 0) this.tape.learnRun(ref.runId, ref.fromMs);
      const part = this.tape.get(ref);
      const state = part === null ? this.loads.stateOfRef(ref) : 'ready';
      if (part !== null) parts.push(this.#open(part));
      else if (state === 'damaged') damaged.push(ref);
      else if (state !== 'gone')
        pending.push(this.#pending(ref, nameOfRef(ref), () => void this.loads.segment(ref)));
    }
    return { parts, pending, damaged };
  }

  #pages({ fromMs, toMs }: Span): Pending[] {
    const { timeline } = this.source;
    if (timeline === null) return [];
    const pages: Pending[] = [];
    const first = Math.max(fromMs, timeline.fromMs);
    const last = Math.min(toMs, timeline.toMs);
    for (let page = Math.floor(first / PAGE_MS); page * PAGE_MS <= last; page += 1) {
      const name = `index ${page}`;
      if (['none', 'loading', 'away'].includes(this.loads.stateOf(name))) {
        const span = { fromMs: page * PAGE_MS, toMs: Math.min((page + 1) * PAGE_MS, timeline.toMs) };
        pages.push(this.#pending({ ...span, take: '', index: 0 }, name, () => void this.loads.index(page)));
      }
    }
    return pages;
  }

  #pending(
    { fromMs, toMs, take, index }: Span & { take: string; index: number },
    name: string,
    begin: () => void,
  ): Pending {
    const state = this.loads.stateOf(name);
    const isReplaceable =
      state === 'away' || (state === 'loading' && this.loads.waitedMs(name) > PATIENCE_MS);
    return { fromMs, toMs, take, index, state, isReplaceable, begin };
  }

  #open(part: TapePart): TapePart {
    if (part.isOpen) return part;
    const alignment = part.frames.length > 0 ? this.own.align(part.frames) : null;
    if (alignment !== null) this.onAlign(alignment);
    return part;
  }

  #isLost(ref: SegmentRef): boolean {
    const state = this.loads.stateOfRef(ref);
    return state === 'damaged' || state === 'gone';
  }
}

/** When the last of the segments with frames ends; -∞ if there is none. */
function endOf(refs: readonly SegmentRef[]): number {
  return refs.reduce(
    (end, { frames, toMs }) => (frames > 0 ? Math.max(end, toMs) : end),
    Number.NEGATIVE_INFINITY,
  );
}
