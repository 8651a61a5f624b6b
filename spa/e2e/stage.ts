/** What every browser test stands on: one browser a file, one stack and fresh pages a test, and what no page may do. */

import { afterAll, afterEach, beforeAll, beforeEach, expect } from 'vitest';
import { openChromium } from './driver/chromium.ts';
import type { Browser, BrowserOptions, Page, PageOptions } from './driver/page.ts';
import { Stack } from './stack.ts';

export interface Stage {
  readonly stack: Stack;
  newPage(options?: PageOptions): Promise<Page>;
}

/** Call once at the top of a test file. */
export function setStage(options: BrowserOptions = {}): Stage {
  let browser: Browser | null = null;
  let stack = new Stack();
  let pages: Page[] = [];

  beforeAll(async () => {
    browser = await openChromium(options);
  });

  beforeEach((context) => {
    stack = new Stack();
    pages = [];
    const ofThisTest = stack;
    context.onTestFailed(() => console.error(ofThisTest.logs));
  });

  afterEach(async () => {
    const errors = pages.flatMap((page) => page.errors);
    const foreign = pages.flatMap((page) => page.foreign);
    for (const page of pages) await page.close();
    await stack.down();
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
    async newPage(pageOptions = {}) {
      if (browser === null) throw new Error('no browser yet');
      const page = await browser.newPage(pageOptions);
      pages.push(page);
      return page;
    },
  };
}
