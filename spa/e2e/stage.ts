/** The basis of every browser test: one browser for the files of a process, one stack and fresh pages per test, and rules that no
 *  page may break. */

import { afterAll, afterEach, beforeAll, beforeEach, expect, type TestContext } from 'vitest';
import { CLOUD } from './cloud.ts';
import { keepBrowser } from './driver/engines.ts';
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
  /** What all tests of this file look at and none changes: `start` is called by the first one that asks. Call it beside
   *  `setStage`. */
  share<T>(start: (stack: Stack) => Promise<T>): () => Promise<T>;
}

/** Software renders 3D as slowly as the slowest phone: without this, a page would switch to the light view in the middle of a
 *  test. A test with its own settings (`{}` for none) keeps those. */
const KEEP_3D = `(() => {
  try {
    if (localStorage.getItem('posecast.settings') === null) localStorage.setItem('posecast.settings', '{"body":"3d"}');
  } catch {} // no storage here
})()`;

/** Whether pages draw the body's pixels though no test reads them: for screenshots to look at. */
const PAINTED = FULL || process.env.POSECAST_PAINTED === '1';

/** Everything about 3D is real but its pixels: software needs a core to fill them, and hardly any test looks at them. Nor at
 *  sixty pictures a second: one each 60 ms is as on a slow phone. */
const UNPAINTED = `(() => {
  const names = ['clear', 'drawArrays', 'drawElements', 'drawRangeElements', 'drawArraysInstanced', 'drawElementsInstanced'];
  for (const name of names) (window.WebGL2RenderingContext?.prototype ?? {})[name] = () => {};
  const request = window.requestAnimationFrame.bind(window), cancel = window.cancelAnimationFrame.bind(window);
  const waiting = new Map();
  let last = 0;
  window.requestAnimationFrame = (draw) => {
    const id = ++last;
    const timer = setTimeout(() => {
      const frame = request((nowMs) => {
        waiting.delete(id);
        draw(nowMs);
      });
      waiting.set(id, () => cancel(frame));
    }, 50);
    waiting.set(id, () => clearTimeout(timer));
    return id;
  };
  window.cancelAnimationFrame = (id) => {
    waiting.get(id)?.();
    waiting.delete(id);
  };
})()`;

export interface StageOptions extends BrowserOptions {
  /** true: the body's pixels are drawn, because a test reads them. */
  readonly paints?: boolean;
}

/** Call once at the top of a test file. */
export function setStage({ paints = PAINTED, ...options }: StageOptions = {}): Stage {
  let browser: Browser | null = null;
  let stack = new Stack();
  const shared = new Stack();
  let pages: Page[] = [];

  beforeAll(async () => {
    browser = await keepBrowser({ strangersCertificate: CLOUD !== null, ...options });
  });

  beforeEach((context) => {
    stack = new Stack((why) => context.skip(why));
    pages = [];
    const ofThisTest = stack;
    // with the reason, which is not reported for a test that passes on a retry
    context.onTestFailed(({ task }) =>
      console.error(task.result?.errors?.at(-1)?.stack, ofThisTest.logs, shared.logs),
    );
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
    await shared.down();
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
      const preload = `${KEEP_3D};${paints ? '' : UNPAINTED};${pageOptions.preload ?? ''}`;
      const page = await this.browser.newPage({ ...pageOptions, preload });
      if (!paints) page.screenshot = async () => undefined; // it would have no body
      pages.push(page);
      return page;
    },
    share(start) {
      let started: ReturnType<typeof start> | null = null;
      return () => {
        started ??= start(shared);
        return started;
      };
    },
  };
}
