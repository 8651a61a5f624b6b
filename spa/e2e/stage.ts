/** The basis of every browser test: one browser per file, one stack and fresh pages per test, and rules that no page may
 *  break. */

import { afterAll, afterEach, beforeAll, beforeEach, expect, type TestContext } from 'vitest';
import { CLOUD } from './cloud.ts';
import { openBrowser } from './driver/engines.ts';
import type { Ability, Browser, BrowserOptions, Page, PageOptions } from './driver/page.ts';
import { Stack } from './stack.ts';

/** Whether to run the slow tests as well: `make test-full`. */
export const FULL = process.env.POSECAST_FULL === '1';

export interface Stage {
  readonly stack: Stack;
  readonly browser: Browser;
  /** Skips the test, with the reason, in an engine whose driver does not support this. */
  needs(context: TestContext, ability: Ability): void;
  newPage(options?: PageOptions): Promise<Page>;
}

/** Software renders 3D as slowly as the slowest phone: without this, a page would switch to the light view in the middle of a
 *  test. A test with its own settings (`{}` for none) keeps those. */
const KEEP_3D = `(() => {
  try {
    if (localStorage.getItem('posecast.settings') === null) localStorage.setItem('posecast.settings', '{"body":"3d"}');
  } catch {} // no storage here
})()`;

/** Call once at the top of a test file. */
export function setStage(options: BrowserOptions = {}): Stage {
  let browser: Browser | null = null;
  let stack = new Stack();
  let pages: Page[] = [];

  beforeAll(async () => {
    browser = await openBrowser({ strangersCertificate: CLOUD !== null, ...options });
  });

  beforeEach((context) => {
    stack = new Stack((why) => context.skip(why));
    pages = [];
    const ofThisTest = stack;
    // with the reason, which is not reported for a test that passes on a retry
    context.onTestFailed(({ task }) => console.error(task.result?.errors?.at(-1)?.stack, ofThisTest.logs));
  });

  afterEach(async () => {
    const errors = pages.flatMap((page) => page.errors);
    const foreign = pages.flatMap((page) => page.foreign);
    try {
      for (const page of pages) await page.close();
    } finally {
      await stack.down();
    }
    expect(errors, 'errors in the console').toEqual([]);
    expect(foreign, 'requests to another origin').toEqual([]);
  });

  afterAll(async () => {
    await browser?.close();
  });

  return {
    get stack() {
      return stack;
    },
    get browser() {
      if (browser === null) throw new Error('no browser yet');
      return browser;
    },
    needs(context, ability) {
      const why = this.browser.lacks[ability];
      if (why !== undefined) context.skip(why);
    },
    async newPage(pageOptions = {}) {
      const preload = `${KEEP_3D};${pageOptions.preload ?? ''}`;
      const page = await this.browser.newPage({ ...pageOptions, preload });
      pages.push(page);
      return page;
    },
  };
}
