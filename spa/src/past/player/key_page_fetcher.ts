import type { PastSource } from '../past_source.ts';
import type { Span } from '../past_types.ts';
import { type Loads, nameOfDay, PAGE_MS } from './tape/loads.ts';

/** How many pages are fetched ahead of a drag, the newest; the others when a finger comes there. */
const ATTENDED_PAGES = 6;
/** A finger that has not moved for so long rests, ms. */
const REST_MS = 150;
/** Along a line longer than this a finger crosses a minute every few pixels, ms. */
const COARSE_MS = 2 * 3_600_000;

/** Fetches what the time line and a drag along it need: days, and the index and first poses, a page of ten minutes at a time. */
export class KeyPageFetcher {
  /** Whether somebody may drag soon. */
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

  /** Somebody may drag soon. Returns whether that is news. */
  attend(): boolean {
    const isNew = !this.isAttended;
    this.isAttended = true;
    if (isNew) void this.fetch();
    return isNew;
  }

  /** Fetches the newest pages, once, the newest first. Does nothing while no timeline is known, nobody may drag, or the line
   *  is so long that a drag needs only what it comes to rest at. */
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

  /** The line shows a span. */
  look(span: Span): void {
    this.#shown = span;
    void this.fetch();
    void this.fetchDays();
  }

  /** Fetches the unknown days that the line shows, the newest first, one by one. */
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

  /** Fetches the page of a moment where a finger is, unless another page is on its way. Along a long line fetches only a pose
   *  of each minute, once the finger rests. */
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

  /** No finger is down. */
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
