/** The basis of every browser test: one browser for the files of a process, one stack and fresh pages per test, and rules that no
 *  page may break. */

import { mkdirSync } from 'node:fs';
import path from 'node:path';
import { afterAll, afterEach, beforeAll, beforeEach, expect, type TestContext } from 'vitest';
import { CLOUD } from './cloud.ts';
import { keepBrowser } from './driver/engines.ts';
import type { Ability, Browser, BrowserOptions, Page, PageOptions } from './driver/page.ts';
import { REPO, type Relay, Stack } from './stack.ts';

/** Whether to run the slow tests as well: `make test-full`. */
export const FULL = process.env.POSECAST_FULL === '1';

export interface Stage {
  readonly stack: Stack;
  readonly browser: Browser;
  /** Skips the test, with the reason, in an engine whose driver does not support this. */
  needs(context: TestContext, ability: Ability): void;
  newPage(options?: PageOptions): Promise<Page>;
  /** A new page at this address. */
  open(url: string, options?: PageOptions): Promise<Page>;
  /** What all tests of this file look at: `start` is called by the first one that asks, and again by the one after a test that
   *  failed. Pages from its `newPage` stay open till the end of the file; each test leaves them as it found them. Call it
   *  beside `setStage`. */
  share<T>(start: (stack: Stack, newPage: Stage['newPage']) => Promise<T>): () => Promise<T>;
  /** The relay of a demo robot that all tests of this file share. */
  demo(): Promise<Relay>;
}

/** Software renders 3D as slowly as the slowest phone: without this, a page would switch to the light view in the middle of a
 *  test. A test with its own settings (`{}` for none) keeps those. */
const KEEP_3D = `(() => {
  try {
    if (localStorage.getItem('posecast.settings') === null) localStorage.setItem('posecast.settings', '{"body":"3d"}');
  } catch {} // no storage here
})()`;

/** Where pages save their pictures, unless a test names another folder. */
const SHOTS = path.join(REPO, 'spa/e2e/shots');
mkdirSync(SHOTS, { recursive: true });

/** Whether pages draw the body's pixels though no test reads them: for screenshots to look at. */
const PAINTED = FULL || process.env.POSECAST_PAINTED === '1';

/** Everything about 3D is real but its pixels: software needs a core to fill them, and hardly any test looks at them. A page
 *  fills them once `window.painting` is true. */
const UNPAINTED = `(() => {
  const gl = window.WebGL2RenderingContext?.prototype ?? {};
  for (const name of ['clear', 'drawArrays', 'drawElements', 'drawRangeElements', 'drawArraysInstanced', 'drawElementsInstanced']) {
    const draw = gl[name];
    gl[name] = function (...how) {
      if (window.painting) draw.apply(this, how);
    };
  }
})()`;

/** Nor at sixty pictures a second: one each 60 ms is as on a slow phone. */
const SELDOM = `(() => {
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
  let skip = (why: string): never => {
    throw new Error(why);
  };
  let shared = new Stack((why) => skip(why));
  let pages: Page[] = [];
  const sharedPages: Page[] = [];
  /** How often what the tests share was begun anew. */
  let times = 0;
  let failed = false;

  async function endShared(): Promise<void> {
    for (const page of sharedPages.splice(0)) await page.close();
    await shared.down();
  }

  async function openPage(pageOptions: PageOptions): Promise<Page> {
    const rate = PAINTED || process.env.POSECAST_WRITE_PICTURES === '1' ? '' : SELDOM;
    const preload = `${KEEP_3D};${paints ? '' : UNPAINTED};${rate};${pageOptions.preload ?? ''}`;
    const page = await stage.browser.newPage({ ...pageOptions, preload });
    const shoot = page.screenshot.bind(page);
    page.screenshot = async (name) => {
      if (paints) await shoot(path.resolve(SHOTS, name)); // otherwise it would have no body
    };
    return page;
  }

  async function openShared(pageOptions: PageOptions = {}): Promise<Page> {
    const page = await openPage(pageOptions);
    sharedPages.push(page);
    return page;
  }

  beforeAll(async () => {
    browser = await keepBrowser({ strangersCertificate: CLOUD !== null, ...options });
  });

  beforeEach(async (context) => {
    if (failed) {
      await endShared();
      shared = new Stack((why) => skip(why));
      times += 1;
      failed = false;
    }
    skip = (why) => context.skip(why);
    stack = new Stack(skip);
    pages = [];
    const ofThisTest = stack;
    context.onTestFailed(({ task }) => {
      failed = true;
      // with what its processes said
      console.error(task.result?.errors?.at(-1)?.stack, ofThisTest.logs, shared.logs);
    });
  });

  afterEach(async () => {
    const seen = [...pages, ...sharedPages];
    const errors = seen.flatMap((page) => page.errors);
    const foreign = seen.flatMap((page) => page.foreign);
    try {
      for (const page of pages) await page.close();
    } finally {
      await stack.down();
    }
    expect(errors, 'errors in the console').toEqual([]);
    expect(foreign, 'requests to another origin').toEqual([]);
  });

  afterAll(endShared);

  const stage: Stage = {
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
      const page = await openPage(pageOptions);
      pages.push(page);
      return page;
    },
    async open(url, pageOptions) {
      const page = await stage.newPage(pageOptions);
      await page.open(url);
      return page;
    },
    share(start) {
      let started: ReturnType<typeof start> | null = null;
      let startedAt = times;
      return () => {
        if (startedAt !== times) started = null;
        startedAt = times;
        started ??= start(shared, openShared).catch((error: unknown) => {
          started = null; // so that the next test is skipped, or tries it, by itself
          throw error;
        });
        return started;
      };
    },
    demo: () => demo(),
  };
  const demo = stage.share((ofAll) => ofAll.demo());
  return stage;
}
