/** WebKitGTK's MiniBrowser behind the interface of `page.ts`, over WebDriver (https://www.w3.org/TR/webdriver2/). */

import { existsSync, mkdirSync, mkdtempSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { Process } from '../process.ts';
import { Complaints } from './complaints.ts';
import { openDisplay } from './display.ts';
import { freePort } from './free_port.ts';
import type { Browser, BrowserOptions, Page, PageOptions, Viewport } from './page.ts';
import { type RemoteEnd, RemotePage } from './remote_page.ts';
import { until } from './until.ts';
import { WatchingProxy } from './watching_proxy.ts';

const DRIVER = process.env.POSECAST_WEBKIT_DRIVER ?? '/usr/bin/WebKitWebDriver';
const BROWSER = process.env.POSECAST_WEBKIT ?? miniBrowser();
const ANSWER_MS = 60_000;
const HANDSHAKE_MS = 2_000;
/** A window whose size has been stable for this long will keep it. */
const SETTLED_MS = 2_000;

const LACKS = {
  touch: 'WebKitWebDriver plays no touch',
  buttons: 'WebKitWebDriver lets go of the left button only',
  wheel: 'WebKitWebDriver turns a wheel back when it lets go of it',
  colors: 'WebKitGTK knows no forced colours',
  slow: 'WebKitWebDriver has no word for a slow processor',
  stop: 'WebKitWebDriver does not tell what a page runs in',
  drops: 'WebKitWebDriver begins a drag and never drops',
  files: 'WebKitWebDriver drags no files from the desktop',
  cache: 'under automation MiniBrowser has a private session, which keeps no answers',
};

/** On a busy machine, the two clicks of one command may be further apart than a person's. */
const DOUBLE_CLICK_MS = 2000;

/** MiniBrowser's toolbar would keep the window wider than a phone. */
const GTK_CSS =
  'button, entry, toolbar, headerbar { padding: 0; margin: 0; min-width: 0; min-height: 0; border-width: 0; }';

/** This protocol sends no events, so the page reports them: logged errors, exceptions, and requests blocked by policy. */
const COMPLAIN = `(() => {
  const say = globalThis.postDriver;
  const words = (thing) => (thing instanceof Error ? thing + '\\n' + thing.stack : String(thing));
  const logged = console.error;
  console.error = (...parts) => { say(parts.map(words).join(' ')); logged(...parts); };
  const uncaught = (event) => say('uncaught: ' + words(event.error ?? event.message));
  addEventListener('error', (event) => { if (event instanceof ErrorEvent) uncaught(event); });
  addEventListener('unhandledrejection', (event) => say('uncaught: ' + words(event.reason)));
  addEventListener('securitypolicyviolation', (event) => say('held back by policy: ' + event.blockedURI));
  const NativeWorker = Worker;
  globalThis.Worker = class Worker extends NativeWorker {
    constructor(...how) { super(...how); this.addEventListener('error', uncaught); }
  };
})();`;

export async function openWebKitGtk(options: BrowserOptions = {}): Promise<Browser> {
  const home = mkdtempSync(path.join(tmpdir(), 'posecast-webkit-'));
  const display = await openDisplay();
  const env = {
    ...display.env,
    GDK_BACKEND: 'x11',
    HOME: home,
    XDG_CONFIG_HOME: gtkSettings(home),
    XDG_CACHE_HOME: home,
    XDG_DATA_HOME: home,
    NO_AT_BRIDGE: '1',
    LC_ALL: 'C.UTF-8', // the hardest one: its language is unknown to Intl
    DBUS_SESSION_BUS_ADDRESS: 'disabled:',
  };
  const args = ['--automation', ...(options.webgl === false ? ['--enable-webgl=false'] : [])];
  const pages = new Set<Page>();
  const close = async (): Promise<void> => {
    for (const page of pages) await page.close();
    await display.close();
    rmSync(home, { recursive: true, force: true, maxRetries: 3 });
  };
  const start = async (pageOptions: PageOptions = {}): Promise<Page> => {
    const { motion, scheme } = pageOptions.media ?? {};
    const settings = motion === 'reduce' ? { XDG_CONFIG_HOME: gtkSettings(home, false) } : {};
    const dark = scheme === 'dark' ? ['--dark-mode'] : []; // overrides GTK's own setting
    const page = await newPage({ ...env, ...settings }, [...args, ...dark], pageOptions);
    pages.add(page);
    return page;
  };
  try {
    const { end, version } = await WebKitEnd.start(env, args, null);
    await end.close();
    return { engine: 'webkitgtk', version, lacks: LACKS, newPage: start, close };
  } catch (cause) {
    await close();
    throw cause;
  }
}

/** A folder with GTK's settings at startup; a page asks GTK whether to reduce motion. */
function gtkSettings(home: string, animations = true): string {
  const folder = mkdtempSync(path.join(home, 'settings-'));
  const put = (name: string, text: string) => writeFileSync(path.join(folder, 'gtk-3.0', name), text);
  mkdirSync(path.join(folder, 'gtk-3.0'));
  put('gtk.css', GTK_CSS);
  put(
    'settings.ini',
    `[Settings]\ngtk-enable-animations=${animations}\ngtk-double-click-time=${DOUBLE_CLICK_MS}\n`,
  );
  return folder;
}

/** A page is a separate browser here: one driver serves one session, and the pages of a session share their storage. */
async function newPage(
  env: Readonly<Record<string, string>>,
  args: readonly string[],
  options: PageOptions,
): Promise<Page> {
  const complaints = new Complaints();
  const preload = `${COMPLAIN}\n${options.preload ?? ''}`;
  const proxy = await WatchingProxy.open({ preload, onReport: (text) => complaints.add(text) });
  try {
    const { end } = await WebKitEnd.start(env, args, proxy.port);
    await end.resize(options.viewport ?? { width: 1280, height: 800 });
    return new RemotePage(end, proxy, complaints);
  } catch (cause) {
    await proxy.close();
    throw cause;
  }
}

interface Session {
  readonly sessionId: string;
  readonly capabilities: { readonly browserVersion: string };
}

class WebKitEnd implements RemoteEnd {
  readonly #driver: Process;
  readonly #url: string;

  private constructor(driver: Process, url: string) {
    this.#driver = driver;
    this.#url = url;
  }

  static async start(
    env: Readonly<Record<string, string>>,
    args: readonly string[],
    proxyPort: number | null,
  ): Promise<{ end: WebKitEnd; version: string }> {
    const port = await freePort(); // a driver that chooses a free port does not say which
    const driver = new Process('WebKitWebDriver', DRIVER, ['--host=127.0.0.1', `--port=${port}`], {
      group: true,
      env,
    });
    try {
      const url = `http://127.0.0.1:${port}`;
      await until('WebKitWebDriver listens', () => command(url, 'GET', '/status'));
      const proxy =
        proxyPort === null ? {} : { proxy: { proxyType: 'manual', httpProxy: `127.0.0.1:${proxyPort}` } };
      const { sessionId, capabilities } = await command<Session>(url, 'POST', '/session', {
        capabilities: {
          alwaysMatch: {
            browserName: 'MiniBrowser',
            pageLoadStrategy: 'eager', // a load that never ends would block every command
            'webkitgtk:browserOptions': { binary: BROWSER, args },
            ...proxy,
          },
        },
      });
      const end = new WebKitEnd(driver, `${url}/session/${sessionId}`);
      return { end, version: capabilities.browserVersion };
    } catch (cause) {
      await driver.stop();
      throw new Error(`no WebKitGTK: ${driver.log}`, { cause });
    }
  }

  /** A hash change within a document is not a load, and this driver would wait for one. The first answer after a load may also
   *  get lost, so an idle question is repeated until one arrives. */
  async navigate(url: string): Promise<void> {
    const to = JSON.stringify(url);
    const stays = `location.href.split('#')[0] === ${to}.split('#')[0] && ${to}.includes('#')`;
    if ((await this.evaluate(`${stays} ? String(location.href = ${to}) : null`)) !== null) return;
    await this.#post('/url', { url });
    await this.#says('document.readyState');
  }

  async reload(): Promise<void> {
    await this.#post('/refresh', {});
    await this.#says('document.readyState');
  }

  async loaded(): Promise<void> {
    await this.#says('document.readyState === "complete" || null');
  }

  /** A script for a document that unloads meanwhile is never answered. */
  #says(expression: string): Promise<string> {
    return until('the page answers', () => this.#run(expression, HANDSHAKE_MS), ANSWER_MS);
  }

  evaluate(expression: string): Promise<string | null> {
    return this.#run(expression);
  }

  async perform(actions: readonly unknown[]): Promise<void> {
    await this.#post('/actions', { actions });
    await command(this.#url, 'DELETE', '/actions');
  }

  /** Only the window can be sized; the viewport is the remaining part, a moment later. The border is measured before the window
   *  changes and again once it is at rest: in between, the two don't match. */
  async resize(size: Viewport): Promise<void> {
    const inner = async (): Promise<Viewport> =>
      JSON.parse((await this.evaluate('JSON.stringify({ width: innerWidth, height: innerHeight })')) ?? '');
    const fits = async (): Promise<boolean> => {
      const { width, height } = await inner();
      return width === size.width && height === size.height;
    };
    await until(`a viewport of ${size.width} × ${size.height}`, async () => {
      const outer = await command<Viewport>(this.#url, 'GET', '/window/rect');
      const { width, height } = await inner();
      await this.#post('/window/rect', {
        width: Math.max(1, size.width + outer.width - width),
        height: Math.max(1, size.height + outer.height - height),
      });
      return until('it fits', fits, SETTLED_MS).catch(() => false);
    });
  }

  async capture(): Promise<Buffer> {
    return Buffer.from(await command<string>(this.#url, 'GET', '/screenshot'), 'base64');
  }

  async close(): Promise<void> {
    if (!this.#driver.running) return;
    await command(this.#url, 'DELETE', '').catch(() => undefined); // the browser may already be gone
    await this.#driver.stop();
  }

  #run(expression: string, answerMs = ANSWER_MS): Promise<string | null> {
    const body = { script: `return ${expression}`, args: [] };
    return command(this.#url, 'POST', '/execute/sync', body, answerMs);
  }

  #post<T>(route: string, body: object): Promise<T> {
    return command<T>(this.#url, 'POST', route, body);
  }
}

async function command<T>(
  url: string,
  method: string,
  route: string,
  body?: object,
  answerMs = ANSWER_MS,
): Promise<T> {
  const answer = await fetch(url + route, {
    method,
    signal: AbortSignal.timeout(answerMs),
    ...(body === undefined ? {} : { body: JSON.stringify(body) }),
  });
  const { value } = (await answer.json()) as { value: T & { error?: string; message?: string } };
  if (!answer.ok) throw new Error(`${method} ${route}: ${value.error}: ${value.message}`);
  return value;
}

/** Debian's location: a folder named after the architecture. */
function miniBrowser(): string {
  const places = readdirSync('/usr/lib')
    .flatMap((machine) =>
      ['webkit2gtk-4.1', 'webkitgtk-6.0'].map((api) => `/usr/lib/${machine}/${api}/MiniBrowser`),
    )
    .filter((place) => existsSync(place));
  return places[0] ?? 'MiniBrowser';
}
