/** Chromium behind the words of `page.ts`, by Playwright's library (its test runner is not used). */

import { type BrowserContext, chromium, type Locator, type Page as PlaywrightPage } from 'playwright-core';
import type { Browser, BrowserOptions, Element, Page, PageOptions, Role, Viewport } from './page.ts';

const EXECUTABLE = process.env.POSECAST_CHROMIUM ?? '/usr/bin/chromium';

const ARGS = [
  '--no-sandbox',
  '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update',
  '--disable-default-apps',
  '--disable-sync',
  // nothing but loopback has a name: what the page or the browser asks of the world goes nowhere
  '--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1',
];
const WEBGL = ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'];

/** What Chromium itself logs about a connection that a test has cut; the page can't silence it. */
const NETWORK_LOG = /^Failed to load resource: net::ERR_|^WebSocket connection to '[^']*' failed/;

export async function openChromium(options: BrowserOptions = {}): Promise<Browser> {
  const browser = await chromium.launch({
    executablePath: EXECUTABLE,
    headless: true,
    args: [...ARGS, ...(options.webgl === false ? ['--disable-3d-apis'] : WEBGL)],
  });
  return {
    version: browser.version(),
    async newPage(pageOptions: PageOptions = {}): Promise<Page> {
      const viewport = pageOptions.viewport ?? { width: 1280, height: 800 };
      const context = await browser.newContext({ viewport });
      if (pageOptions.preload !== undefined) await context.addInitScript(pageOptions.preload);
      return new ChromiumPage(context, await context.newPage());
    },
    close: () => browser.close(),
  };
}

class ChromiumPage implements Page {
  readonly errors: string[] = [];
  readonly foreign: string[] = [];
  readonly requested: string[] = [];
  #host: string | null = null;
  readonly #forgiven: RegExp[] = [];
  readonly #context: BrowserContext;
  readonly #page: PlaywrightPage;

  constructor(context: BrowserContext, page: PlaywrightPage) {
    this.#context = context;
    this.#page = page;
    context.on('request', (request) => this.#saw(request.url()));
    page.on('websocket', (socket) => this.#saw(socket.url()));
    page.on('pageerror', (error) => this.#complain(`uncaught: ${error.stack ?? error.message}`));
    page.on('console', (message) => {
      if (message.type() === 'error') this.#complain(message.text());
    });
  }

  async open(url: string): Promise<void> {
    this.#host = new URL(url).host;
    await this.#page.goto(url, { waitUntil: 'domcontentloaded' });
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

  viewport(size: Viewport): Promise<void> {
    return this.#page.setViewportSize(size);
  }

  async screenshot(path: string): Promise<void> {
    await this.#page.screenshot({ path });
  }

  forgive(pattern: RegExp): void {
    this.#forgiven.push(pattern);
    for (let i = this.errors.length - 1; i >= 0; i--) {
      if (pattern.test(this.errors[i] ?? '')) this.errors.splice(i, 1);
    }
  }

  close(): Promise<void> {
    return this.#context.close();
  }

  #complain(text: string): void {
    if (NETWORK_LOG.test(text) || this.#forgiven.some((pattern) => pattern.test(text))) return;
    this.errors.push(text);
  }

  #saw(address: string): void {
    this.requested.push(address);
    const url = new URL(address);
    if (url.protocol === 'data:' || url.protocol === 'blob:') return;
    if (url.host !== this.#host) this.foreign.push(address);
  }
}

function element(locator: Locator): Element {
  return {
    count: () => locator.count(),
    // biome-ignore lint/performance/useDomNodeTextContent: what a reader sees, not what is in the tree
    text: () => locator.innerText(),
    attribute: (name) => locator.getAttribute(name),
    visible: () => locator.isVisible(),
    click: () => locator.click(),
    type: (text) => locator.fill(text),
  };
}
