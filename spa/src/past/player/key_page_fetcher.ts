import type { PastSource } from '../past_source.ts';
import { PAGE_MS, type Span } from '../past_types.ts';
import { type Loads, nameOfDay } from './tape/loads.ts';

/** How many pages are prefetched for dragging, newest first; the others are fetched when a finger reaches them. */
const ATTENDED_PAGES = 6;
/** A finger that has not moved for this long is at rest, ms. */
const REST_MS = 150;
/** On a line longer than this, a finger crosses a minute every few pixels, ms. */
const COARSE_MS = 2 * 3_600_000;

/** Fetches the data that the time line and dragging need: days, and the index and first poses, in pages of ten minutes. */
export class KeyPageFetcher {
  /** Whether the viewer may drag soon. */
  isAttended = false;
  #isAsked = false;
  #isBusy = false;
  #shown: Span = { fromMs: 0, toMs: 0 };
  #isFetchingDays = false;
  #cancelRest = (): void => undefined;

  constructor(
    private readonly source: PastSource,
    private readonly loads: Loads,
    private readonly schedule: (run: () => void, afterMs: number) => () => void,
  ) {}

  /** The viewer may drag soon. Returns whether that is new. */
  attend(): boolean {
    const isNew = !this.isAttended;
    this.isAttended = true;
    if (isNew) void this.fetch();
    return isNew;
  }

  /** Fetches the newest pages once, newest first. Does nothing while no timeline is known, while no drag is expected, or if the
   *  line is so long that a drag only needs data where it stops. */
  async fetch(): Promise<void> {
    const { timeline } = this.source;
    if (timeline === null || this.#isAsked || !this.isAttended || this.#isCoarse) return;
    this.#isAsked = true;
    const newest = Math.floor(timeline.toMs / PAGE_MS);
    const oldest = Math.max(Math.floor(timeline.fromMs / PAGE_MS), newest - ATTENDED_PAGES + 1);
    for (let page = newest; page >= oldest; page -= 1) {
      await this.#fetchPage(page);
      const pose = this.source.keyAt(page * PAGE_MS);
      if (pose !== null) await this.loads.reader(pose.schema).catch(() => undefined);
    }
  }

  /** The line shows this span. */
  look(span: Span): void {
    this.#shown = span;
    void this.fetch();
    void this.fetchDays();
  }

  /** Fetches the unknown days that the line shows, newest first, one at a time. */
  async fetchDays(): Promise<void> {
    if (this.#isFetchingDays) return;
    this.#isFetchingDays = true;
    const tried = new Set<string>();
    const isWanted = ({ fromMs, toMs }: Span) =>
      fromMs < this.#shown.toMs && toMs > this.#shown.fromMs && !tried.has(nameOfDay(fromMs));
    for (let day = this.#unknown(isWanted); day !== null; day = this.#unknown(isWanted)) {
      tried.add(nameOfDay(day.fromMs));
      await this.loads.day(day.fromMs);
    }
    this.#isFetchingDays = false;
  }

  /** Fetches the page under a finger, unless another page is being fetched. On a long line, fetches only one pose per minute,
   *  once the finger rests. */
  async want(momentMs: number): Promise<void> {
    this.stop();
    const page = Math.floor(momentMs / PAGE_MS);
    if (this.#isCoarse) {
      this.#cancelRest = this.schedule(() => void this.loads.keys(page, true), REST_MS);
      return;
    }
    if (this.#isBusy || !['none', 'away'].includes(this.loads.stateOf(`keys ${page}`))) return;
    this.#isBusy = true;
    await this.#fetchPage(page);
    this.#isBusy = false;
  }

  /** The finger was lifted. */
  stop(): void {
    this.#cancelRest();
  }

  get #isCoarse(): boolean {
    return this.#shown.toMs - this.#shown.fromMs > COARSE_MS;
  }

  #unknown(isWanted: (day: Span) => boolean): Span | null {
    return this.source.timeline?.unknown?.findLast(isWanted) ?? null;
  }

  async #fetchPage(page: number): Promise<void> {
    await Promise.all([this.loads.index(page), this.loads.keys(page)]);
  }
}
