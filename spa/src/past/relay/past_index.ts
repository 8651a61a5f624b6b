import { BoundedCache, firstPlace } from '../../kit.ts';
import { nameOfRef, PastError, type SegmentRef } from '../past_source.ts';
import { DAY_MS, MINUTE_MS, PAGE_MS, type Span, type Timeline } from '../past_types.ts';
import {
  minuteOf,
  type PastDeletions,
  type PastMinute,
  type PastPage,
  type PastSummary,
  SEGMENTS_MAX,
} from './past_documents.ts';
import { drawTimeline, type KnownMinute } from './past_timeline.ts';

/** For pages as JSON, at most 100,000 segments: an entry has more than 250 bytes. */
const PAGES_BYTES_MAX = 25_000_000;
/** The number of days whose minutes are kept: a week and its surroundings. */
const DAYS_MAX = 16;
/** A past up to this long is fetched whole, by minutes; of a longer one, only the days that the viewer looks at. */
const SHORT_MS = 3_600_000;
/** If a clock was set back by more than this, all known data is wrong. */
const SET_BACK_MS = 60_000;
/** This long after its end, a page gets no more segments: one lasts at most 6 s, as long as the relay's clock is not set back. */
const CLOSED_MS = 10_000;

/** Maximum number of spans remembered as deleted. */
const DELETED_MAX = 1000;

interface IndexPage {
  readonly segments: ReadonlyMap<string, SegmentRef>;
  /** The last one that the relay listed. */
  readonly last: SegmentRef | null;
  /** Size as JSON. */
  readonly bytes: number;
  /** Everything that starts before this is known. */
  readonly knownMs: number;
}

interface Day {
  readonly minutes: readonly KnownMinute[];
  /** The pages that contain them. */
  readonly pagesMs: ReadonlySet<number>;
  /** The newest moment at the time of the request. */
  readonly knownMs: number;
}

/** The start of the ten minutes that contain a moment. */
export function pageOf(atMs: number): number {
  return atMs - (atMs % PAGE_MS);
}

/** What is known about the recorded data: its extent, by minutes, and by segments for fetched pages. Times are the relay's. */
export class PastIndex {
  readonly #days = new BoundedCache<number, Day>(DAYS_MAX);
  readonly #pages = new BoundedCache<number, IndexPage>(PAGES_BYTES_MAX);
  #summary: PastSummary | null = null;
  #deletions: PastDeletions = { view: '', spans: [] };
  #toMs = 0;
  #segments: readonly SegmentRef[] | null = null;
  #timeline: Timeline | null = null;

  get summary(): PastSummary | null {
    return this.#summary;
  }

  /** What was deleted, as far as the relay has said. Every change makes a new array. */
  get deleted(): readonly Span[] {
    return this.#deletions.spans;
  }

  /** Whether a segment of this span was deleted. */
  isDeleted(span: Span): boolean {
    return this.deleted.some((deleted) => overlaps(span, deleted));
  }

  /** The end of the newest segment. */
  get toMs(): number {
    return this.#toMs;
  }

  /** The start of the window. */
  get fromMs(): number {
    const { fromMs, pastMs } = this.#summary ?? { fromMs: 0, pastMs: 0 };
    return Math.max(fromMs, this.#toMs - pastMs);
  }

  /** The starts of the fetched pages. */
  get pagesMs(): readonly number[] {
    return this.#pages.entries().map(([pageMs]) => pageMs);
  }

  get timeline(): Timeline | null {
    if (this.#summary === null) return null;
    this.#timeline ??= this.#draw();
    return this.#timeline;
  }

  /** Sets the extent. Forgets what lies outside it. If it is a different past than before, forgets everything and returns
   *  true. */
  setSummary(summary: PastSummary | null): boolean {
    const isAnother =
      summary?.view !== this.#summary?.view || (summary?.toMs ?? 0) < this.#toMs - SET_BACK_MS;
    if (isAnother) {
      this.#days.clear();
      this.#pages.clear();
      this.#toMs = 0;
    }
    this.#summary = summary;
    this.#toMs = Math.max(this.#toMs, summary?.toMs ?? 0);
    for (const [dayMs] of this.#days.entries()) if (dayMs + DAY_MS <= this.fromMs) this.#days.delete(dayMs);
    for (const pageMs of this.pagesMs) if (pageMs + PAGE_MS <= this.fromMs) this.#pages.delete(pageMs);
    this.#change();
    return isAnother;
  }

  /** The days in a span whose minutes are unknown or out of date, newest first. */
  listDaysToFetch(span: Span | null): readonly number[] {
    const short = this.#toMs - this.fromMs <= SHORT_MS ? this : null;
    const wanted = new Set([short, span].flatMap((each) => (each === null ? [] : this.#listDays(each))));
    return this.#listDays(this)
      .filter((dayMs) => {
        const day = this.#days.get(dayMs);
        if (day === undefined) return wanted.has(dayMs);
        if (wanted.has(dayMs)) this.#days.use(dayMs);
        // the longer a day's answer, the less often it is requested: a full day has more than 100 kB
        const afterMs = Math.max(1, Math.floor(day.minutes.length / 120)) * MINUTE_MS;
        const nextMs = day.knownMs - (day.knownMs % MINUTE_MS) + afterMs;
        return day.knownMs < dayMs + DAY_MS + CLOSED_MS && this.#toMs >= nextMs;
      })
      .slice(0, DAYS_MAX);
  }

  /** `knownMs`: the newest moment at the time of the request. */
  setDay(dayMs: number, minutes: readonly PastMinute[], knownMs: number): void {
    const known = this.#withoutDeleted(minutes).map(({ atMs, bytes, ...more }) => {
      const lastedMs = Math.min(atMs + MINUTE_MS, knownMs) - Math.max(atMs, this.fromMs);
      return { ...more, atMs, bytesPerS: (1000 * bytes) / Math.max(1000, lastedMs) };
    });
    const pagesMs = new Set(known.map(({ atMs }) => pageOf(atMs)));
    this.#days.set(dayMs, { minutes: known.sort((a, b) => a.atMs - b.atMs), pagesMs, knownMs }, 1);
    this.#change();
  }

  /** The pages in a span that have data, newest first. */
  listPages(span: Span): readonly number[] {
    const fromMs = Math.max(span.fromMs, this.fromMs);
    const toMs = Math.min(span.toMs, this.#toMs);
    const found: number[] = [];
    for (const dayMs of this.#listDays({ fromMs, toMs })) {
      const day = this.#days.get(dayMs);
      const firstMs = pageOf(Math.max(fromMs, dayMs));
      for (let pageMs = pageOf(Math.min(toMs, dayMs + DAY_MS - 1)); pageMs >= firstMs; pageMs -= PAGE_MS)
        if (day === undefined || day.knownMs < pageMs + PAGE_MS || day.pagesMs.has(pageMs))
          found.push(pageMs);
    }
    return found;
  }

  /** Whether everything in a page that starts before `untilMs` is known, as far as it exists by now. */
  knows(pageMs: number, untilMs: number): boolean {
    const page = this.#pages.use(pageMs);
    return page !== undefined && page.knownMs >= Math.min(untilMs, this.#toMs, pageMs + PAGE_MS);
  }

  isClosed(pageMs: number): boolean {
    return (this.#pages.get(pageMs)?.knownMs ?? 0) >= pageMs + PAGE_MS;
  }

  /** The number of segments with frames in a page; null if the page was not fetched. */
  countPoses(pageMs: number): number | null {
    const page = this.#pages.get(pageMs);
    return page ? [...page.segments.values()].filter(({ frames }) => frames > 0).length : null;
  }

  /** The last segment that the relay listed for a page. */
  getLast(pageMs: number): SegmentRef | null {
    return this.#pages.get(pageMs)?.last ?? null;
  }

  /** The time up to which a page is fully known if the relay answers at `atMs`, by its clock. */
  findKnownMs(pageMs: number, atMs: number): number {
    const endMs = pageMs + PAGE_MS;
    return atMs >= endMs + CLOSED_MS ? endMs : Math.min(this.#toMs, endMs - 1);
  }

  /** Adds the relay's answer for a page, `size` bytes of JSON. `knownMs`: from `findKnownMs` before the request. Returns how many
   *  segments are new. Throws a `PastError`. */
  addPage(pageMs: number, { segments, more }: PastPage, size: number, knownMs: number): number {
    const before = this.#pages.get(pageMs) ?? { segments: new Map(), last: null, bytes: 0, knownMs: 0 };
    const all = new Map(before.segments);
    let newestMs = 0;
    for (const ref of segments) {
      newestMs = Math.max(newestMs, ref.toMs);
      if (!this.isDeleted(ref)) all.set(nameOfRef(ref), ref); // a cache may still have the list of before
    }
    if (all.size > SEGMENTS_MAX)
      throw new PastError('damaged', `page ${minuteOf(pageMs)}: more than ${SEGMENTS_MAX} segments`);
    const count = all.size - before.segments.size;
    // an answer without news costs nothing, however often it arrives
    const bytes = before.bytes + (count > 0 ? size : 0);
    const endMs = pageMs + PAGE_MS;
    const saidMs = more ? 0 : Math.max(knownMs, Math.min(newestMs, endMs - 1));
    const page = {
      ...{ segments: all, last: segments.at(-1) ?? before.last },
      ...{ bytes, knownMs: Math.max(before.knownMs, saidMs) },
    };
    this.#pages.set(pageMs, page, bytes);
    this.#toMs = Math.max(this.#toMs, newestMs);
    if (count > 0 || page.knownMs !== before.knownMs) this.#change();
    return segments.filter((ref) => !before.segments.has(nameOfRef(ref))).length;
  }

  /** Forgets what was deleted, now and in later answers: lists in caches may be from before, and relays that share a store hear of
   *  a deletion one after the other. Returns whether any of it is news. */
  forget({ view, spans }: PastDeletions): boolean {
    const before = view === this.#deletions.view ? this.deleted : [];
    const news = spans.filter((span) => !before.some((known) => isSame(span, known)));
    if (news.length === 0) return false;
    this.#deletions = { view, spans: [...before, ...news].slice(-DELETED_MAX) };
    for (const [pageMs, page] of this.#pages.entries()) {
      const segments = new Map([...page.segments].filter(([, ref]) => !this.isDeleted(ref)));
      if (segments.size < page.segments.size) this.#pages.set(pageMs, { ...page, segments }, page.bytes);
    }
    for (const [dayMs, day] of this.#days.entries())
      this.#days.set(dayMs, { ...day, minutes: this.#withoutDeleted(day.minutes) }, 1);
    this.#change();
    return true;
  }

  /** Minutes without those that were deleted. Of one that was deleted in part, it is not known whether its faults are left. */
  #withoutDeleted<T extends Pick<PastMinute, 'atMs' | 'faults'>>(minutes: readonly T[]): T[] {
    return minutes.flatMap((minute) => {
      const span = { fromMs: minute.atMs, toMs: minute.atMs + MINUTE_MS };
      if (!this.isDeleted(span)) return [minute];
      const isWhole = this.deleted.some(({ fromMs, toMs }) => fromMs <= span.fromMs && toMs >= span.toMs);
      return isWhole ? [] : [{ ...minute, faults: 0 }];
    });
  }

  segmentsIn(span: Span, most = Number.POSITIVE_INFINITY): readonly SegmentRef[] {
    const all = this.#listSegments();
    // by start: none lasts longer than a page
    const first = firstPlace(all, ({ fromMs }) => fromMs >= span.fromMs - PAGE_MS);
    const found: SegmentRef[] = [];
    for (let i = first; i < all.length && all[i]!.fromMs <= span.toMs && found.length < most; i++)
      if (all[i]!.toMs >= span.fromMs) found.push(all[i]!);
    return found;
  }

  /** The days in a span that have data, newest first. */
  #listDays({ fromMs, toMs }: Span): readonly number[] {
    // a summary from before midnight does not list the day of the newest data
    const days = new Set([this.#toMs - (this.#toMs % DAY_MS), ...(this.#summary?.daysMs ?? [])]);
    return [...days].filter((dayMs) => dayMs + DAY_MS > fromMs && dayMs <= toMs);
  }

  /** The segments still available, by start, then take, then index. */
  #listSegments(): readonly SegmentRef[] {
    this.#segments ??= this.#pages
      .entries()
      .flatMap(([, { segments }]) => [...segments.values()])
      .filter(({ fromMs }) => fromMs >= this.fromMs)
      .sort(
        (a, b) => a.fromMs - b.fromMs || (a.take < b.take ? -1 : a.take > b.take ? 1 : a.index - b.index),
      );
    return this.#segments;
  }

  #draw(): Timeline {
    const segments = this.#listSegments();
    // a segment that crosses the window's start is no longer available
    const firstMs = segments[0]?.fromMs ?? 0;
    const fromMs = pageOf(firstMs) === pageOf(this.fromMs) ? firstMs : this.fromMs;
    const minutes = this.#days
      .entries()
      .sort(([a], [b]) => a - b)
      .flatMap(([, day]) => day.minutes)
      .map((minute) => ({ ...minute, unknownMs: this.#pages.get(pageOf(minute.atMs))?.knownMs ?? 0 }));
    const unknown = this.#listDays(this)
      .filter((dayMs) => this.#days.get(dayMs) === undefined)
      .map((dayMs) => ({ fromMs: Math.max(dayMs, fromMs), toMs: Math.min(dayMs + DAY_MS, this.#toMs) }))
      .sort((a, b) => a.fromMs - b.fromMs);
    return drawTimeline({ fromMs, toMs: this.#toMs }, segments, minutes, unknown);
  }

  #change(): void {
    this.#segments = null;
    this.#timeline = null;
  }
}

/** Whether a segment has anything in common with a deleted span; both are without their ends. */
function overlaps({ fromMs, toMs }: Span, deleted: Span): boolean {
  return fromMs < deleted.toMs && Math.max(toMs, fromMs + 1) > deleted.fromMs;
}

function isSame(a: Span, b: Span): boolean {
  return a.fromMs === b.fromMs && a.toMs === b.toMs;
}
