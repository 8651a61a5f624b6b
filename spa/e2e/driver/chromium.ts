/** Chromium behind the interface of `page.ts`, using Playwright's library (its test runner is not used). */

import {
  type BrowserContext,
  type CDPSession,
  chromium,
  type Disposable,
  type Locator,
  type Page as PlaywrightPage,
} from 'playwright-core';
import { line } from './actions.ts';
import { Complaints, foreignTo } from './complaints.ts';
import type {
  Browser,
  BrowserOptions,
  Button,
  Element,
  Finger,
  Page,
  PageOptions,
  Point,
  Role,
  Viewport,
} from './page.ts';

const EXECUTABLE = process.env.POSECAST_CHROMIUM ?? '/usr/bin/chromium';

const ARGS = [
  '--no-sandbox',
  '--no-first-run',
  '--enable-precise-memory-info', // otherwise the heap size is reported in steps of tens of megabytes
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-default-apps',
  '--disable-sync',
  // only loopback resolves: requests from the page or the browser to other hosts go nowhere
  '--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1 , EXCLUDE localhost',
];
const WEBGL = [
  ...['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'],
  // SwiftShader for 3D alone: it would take most of a core for a table whose numbers change
  ...['--disable-gpu-compositing', '--disable-gpu-rasterization', '--disable-accelerated-2d-canvas'],
];

/** What Chromium itself logs about a connection that a test has cut; the page can't silence it. */
const NETWORK_LOG = /^Failed to load resource: net::ERR_|^WebSocket connection to '[^']*' failed/;

export async function openChromium(options: BrowserOptions = {}): Promise<Browser> {
  const browser = await chromium.launch({
    executablePath: EXECUTABLE,
    headless: true,
    args: [...ARGS, ...(options.webgl === false ? ['--disable-3d-apis'] : WEBGL)],
  });
  const idle = new Map<string, Tab[]>();
  return {
    engine: 'chromium',
    version: browser.version(),
    lacks: {},
    async newPage({ viewport = { width: 1280, height: 800 }, preload, touch, media = {} }: PageOptions = {}) {
      const kind = JSON.stringify([touch, media]);
      let tab = idle.get(kind)?.pop();
      if (tab === undefined) {
        const context = await browser.newContext({
          viewport,
          hasTouch: touch === true,
          ignoreHTTPSErrors: options.strangersCertificate === true,
          ...(media.motion === undefined ? {} : { reducedMotion: media.motion }),
          ...(media.scheme === undefined ? {} : { colorScheme: media.scheme }),
          ...(media.colors === undefined ? {} : { forcedColors: 'active' as const }),
        });
        context.setDefaultTimeout(100_000);
        tab = { context, page: await context.newPage() };
      } else await tab.page.setViewportSize(viewport);
      const script = preload === undefined ? null : await tab.context.addInitScript(preload);
      const keep = (emptied: Tab) => idle.set(kind, [...(idle.get(kind) ?? []), emptied]);
      return new ChromiumPage(tab, script, keep);
    },
    close: () => browser.close(),
  };
}

/** One that is empty again serves the next page of its kind: to start its process takes as long as the page itself. */
interface Tab {
  readonly context: BrowserContext;
  readonly page: PlaywrightPage;
}

class ChromiumPage implements Page {
  readonly requested: string[] = [];
  readonly #complaints = new Complaints(NETWORK_LOG);
  readonly #context: BrowserContext;
  readonly #page: PlaywrightPage;
  readonly #script: Disposable | null;
  readonly #keep: (emptied: Tab) => void;
  readonly #allowed = new Set<string>();
  #host: string | null = null;
  #devtools: Promise<CDPSession> | null = null;
  #isClosed = false;

  constructor({ context, page }: Tab, script: Disposable | null, keep: (emptied: Tab) => void) {
    this.#context = context;
    this.#page = page;
    this.#script = script;
    this.#keep = keep;
    context.on('request', (request) => this.requested.push(request.url()));
    page.on('websocket', (socket) => this.requested.push(socket.url()));
    page.on('pageerror', (error) => this.#complaints.add(`uncaught: ${error.stack ?? error.message}`));
    page.on('console', (message) => {
      if (message.type() !== 'error') return;
      const isOfAnswer = message.text().startsWith('Failed to load resource: the server responded');
      this.#complaints.add(isOfAnswer ? `${message.text()} ${message.location().url}` : message.text());
    });
  }

  get errors(): readonly string[] {
    return this.#complaints.errors;
  }

  get foreign(): readonly string[] {
    return foreignTo(this.#host, this.#allowed, this.requested);
  }

  async open(url: string): Promise<void> {
    this.#host = new URL(url).host;
    await this.#page.goto(url, { waitUntil: 'domcontentloaded' });
  }

  async reload(): Promise<void> {
    await this.#page.reload({ waitUntil: 'domcontentloaded' });
  }

  async loaded(): Promise<void> {
    await this.#page.waitForLoadState('domcontentloaded');
  }

  evaluate<T>(script: string | (() => T)): Promise<T> {
    return this.#page.evaluate(script as () => T);
  }

  findByRole(role: Role, name?: string | RegExp): Element {
    return element(this.#page.getByRole(role, name === undefined ? {} : { name }));
  }

  findByTestId(id: string): Element {
    return element(this.#page.getByTestId(id));
  }

  text(): Promise<string> {
    return element(this.#page.locator('body')).text();
  }

  press(key: string): Promise<void> {
    return this.#page.keyboard.press(key);
  }

  async drag(from: Point, to: Point, button: Button = 'left'): Promise<void> {
    const { mouse } = this.#page;
    await mouse.move(from.x, from.y);
    await mouse.down({ button });
    for (const { x, y } of line({ from, to })) await mouse.move(x, y);
    await mouse.up({ button });
  }

  async click({ x, y }: Point): Promise<void> {
    const { mouse } = this.#page;
    // sent together: on a slow machine, an answer may take longer than a person's time between down and up
    await Promise.all([mouse.move(x, y), mouse.down(), mouse.up()]);
  }

  doubleClick({ x, y }: Point): Promise<void> {
    return this.#page.mouse.dblclick(x, y);
  }

  async wheel({ x, y }: Point, pixels: number): Promise<void> {
    await this.#page.mouse.move(x, y);
    await this.#page.mouse.wheel(0, pixels);
  }

  async touch(...fingers: Finger[]): Promise<void> {
    const cdp = await this.#cdp();
    const send = (type: 'touchStart' | 'touchMove' | 'touchEnd', points: Point[]) =>
      cdp.send('Input.dispatchTouchEvent', { type, touchPoints: points.map((at, id) => ({ ...at, id })) });
    const moves = fingers.map(line);
    await send(
      'touchStart',
      fingers.map(({ from }) => from),
    );
    for (const step of moves[0]?.keys() ?? []) {
      await send(
        'touchMove',
        moves.map((points) => points[step]!),
      );
    }
    await send('touchEnd', []);
  }

  async doubleTap(at: Point): Promise<void> {
    const cdp = await this.#cdp();
    const touch = (type: 'touchStart' | 'touchEnd') =>
      cdp.send('Input.dispatchTouchEvent', { type, touchPoints: type === 'touchStart' ? [at] : [] });
    // sent together: on a slow machine, an answer may take longer than a person's time between two taps
    await Promise.all([touch('touchStart'), touch('touchEnd'), touch('touchStart'), touch('touchEnd')]);
  }

  async dropFiles({ x, y }: Point, paths: readonly string[]): Promise<void> {
    const cdp = await this.#cdp();
    const data = { items: [], files: [...paths], dragOperationsMask: 1 };
    for (const type of ['dragEnter', 'dragOver', 'drop'] as const) {
      await cdp.send('Input.dispatchDragEvent', { type, x, y, data });
    }
  }

  async slow(times: number): Promise<void> {
    await (await this.#cdp()).send('Emulation.setCPUThrottlingRate', { rate: times });
  }

  async stop(): Promise<() => void> {
    const browser = await this.#context.browser()?.newBrowserCDPSession();
    const found = await browser?.send('SystemInfo.getProcessInfo');
    const renderers = (found?.processInfo ?? [])
      .filter(({ type }) => type === 'renderer')
      .map(({ id }) => id);
    const all = (signal: NodeJS.Signals) => {
      for (const pid of renderers) process.kill(pid, signal);
    };
    all('SIGSTOP');
    return () => all('SIGCONT');
  }

  viewport(size: Viewport): Promise<void> {
    return this.#page.setViewportSize(size);
  }

  async screenshot(path: string): Promise<void> {
    await this.#page.screenshot({ path });
  }

  forgive(pattern: RegExp): void {
    this.#complaints.forgive(pattern);
  }

  allow(host: string): void {
    this.#allowed.add(host);
  }

  async close(): Promise<void> {
    if (this.#isClosed) return;
    this.#isClosed = true;
    for (const name of ['websocket', 'pageerror', 'console'] as const) this.#page.removeAllListeners(name);
    this.#context.removeAllListeners('request');
    const isEmpty = await this.#empty().then(
      () => true,
      () => false,
    );
    if (isEmpty) this.#keep({ context: this.#context, page: this.#page });
    else await this.#context.close();
  }

  /** Leaves the page and forgets what it has stored. Throws an Error if its process does not answer. */
  async #empty(): Promise<void> {
    const cdp = await this.#cdp();
    await this.#script?.dispose();
    await this.#page.evaluate('try { sessionStorage.clear() } catch {}');
    await this.#page.goto('about:blank', { timeout: 5000 });
    const origins = new Set(this.requested.map((url) => new URL(url).origin));
    for (const origin of origins)
      if (origin !== 'null') await cdp.send('Storage.clearDataForOrigin', { origin, storageTypes: 'all' });
    await this.#context.clearCookies();
    await cdp.detach(); // and its slow processor
  }

  /** Chromium's own protocol, for what Playwright does not support. */
  #cdp(): Promise<CDPSession> {
    this.#devtools ??= this.#context.newCDPSession(this.#page);
    return this.#devtools;
  }
}

function element(locator: Locator): Element {
  return {
    count: () => locator.count(),
    // biome-ignore lint/performance/useDomNodeTextContent: the visible text, not everything in the tree
    text: () => locator.innerText(),
    attribute: (name) => locator.getAttribute(name),
    visible: () => locator.isVisible(),
    click: () => locator.click(),
    type: (text) => locator.fill(text),
  };
}
