import type { PastSource } from '../past_source.ts';
import { type Loads, PAGE_MS } from './loads.ts';

/** Of how many ten minutes first poses are fetched when somebody looks; those of others when a finger comes there. */
const ATTENDED_PAGES = 6;

/** Fetches what a drag needs: index and first poses, page by page. */
export class KeyPageFetcher {
  #isAsked = false;
  #isBusy = false;

  constructor(
    private readonly source: PastSource,
    private readonly loads: Loads,
  ) {}

  /** Fetches the newest pages, once, the newest first. Does nothing while no timeline is known. */
  async fetch(): Promise<void> {
    const { timeline } = this.source;
    if (timeline === null || this.#isAsked) return;
    this.#isAsked = true;
    const newest = Math.floor(timeline.toMs / PAGE_MS);
    const oldest = Math.max(Math.floor(timeline.fromMs / PAGE_MS), newest - ATTENDED_PAGES + 1);
    for (let page = newest; page >= oldest; page -= 1) {
      await this.#fetchPage(page);
      const pose = this.source.keyAt(page * PAGE_MS);
      if (pose !== null) await this.loads.reader(pose.schema).catch(() => undefined);
    }
  }

  /** Fetches the page of a moment, unless another one is on its way: a finger moves faster than they come. */
  async want(momentMs: number): Promise<void> {
    const page = Math.floor(momentMs / PAGE_MS);
    if (this.#isBusy || !['none', 'away'].includes(this.loads.stateOf(`keys ${page}`))) return;
    this.#isBusy = true;
    await this.#fetchPage(page);
    this.#isBusy = false;
  }

  async #fetchPage(page: number): Promise<void> {
    await Promise.all([this.loads.index(page), this.loads.keys(page)]);
  }
}
