/** Firefox behind the interface of `page.ts`, over WebDriver BiDi. */

import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { Process } from '../process.ts';
import { BidiConnection } from './bidi.ts';
import { Complaints } from './complaints.ts';
import { openDisplay } from './display.ts';
import type { Browser, BrowserOptions, Page, PageOptions } from './page.ts';
import { type RemoteEnd, RemotePage } from './remote_page.ts';
import { WatchingProxy } from './watching_proxy.ts';

const EXECUTABLE = process.env.POSECAST_FIREFOX ?? '/usr/bin/firefox-esr';

const PREFERENCES = {
  'remote.active-protocols': 1, // BiDi
  // a page sends everything through its own proxy; the browser's own requests go nowhere
  'network.proxy.type': 1,
  'network.proxy.http': '127.0.0.1',
  'network.proxy.http_port': 9,
  'network.proxy.ssl': '127.0.0.1',
  'network.proxy.ssl_port': 9,
  'network.proxy.allow_hijacking_localhost': true,
  'app.normandy.enabled': false,
  'app.update.disabledForTesting': true,
  'browser.safebrowsing.malware.enabled': false,
  'browser.safebrowsing.phishing.enabled': false,
  'datareporting.policy.dataSubmissionEnabled': false,
  'dom.push.connection.enabled': false,
  'services.settings.server': 'http://127.0.0.1:9/',
  'toolkit.telemetry.server': '',
  'dom.w3c_touch_events.enabled': 1,
};

/** System settings seen by a page, as Firefox preferences. */
function mediaPreferences({ motion, scheme, colors }: PageOptions['media'] = {}): Record<string, number> {
  return {
    'ui.prefersReducedMotion': motion === 'reduce' ? 1 : 0,
    'layout.css.prefers-color-scheme.content-override': scheme === 'dark' ? 0 : scheme === 'light' ? 1 : 2,
    'browser.display.document_color_use': colors === 'forced' ? 2 : 0,
  };
}

/** What Firefox itself logs about a connection that a test has cut; the page can't silence it. */
const NETWORK_LOG = [
  /Firefox can’t establish a connection to the server at ws:/,
  /The connection to \S+ was interrupted while the page was loading/,
];

const LACKS = {
  slow: 'WebDriver BiDi has no word for a slow processor',
  stop: 'WebDriver BiDi does not tell what a page runs in',
  drops: 'WebDriver BiDi in this Firefox begins a drag and never drops',
  files: 'WebDriver BiDi drags no files from the desktop',
};

export async function openFirefox(options: BrowserOptions = {}): Promise<Browser> {
  const profile = mkdtempSync(path.join(tmpdir(), 'posecast-firefox-'));
  const preferences = {
    ...PREFERENCES,
    ...(options.webgl === false ? { 'webgl.disabled': true } : { 'webgl.force-enabled': true }),
  };
  writeFileSync(
    path.join(profile, 'user.js'),
    Object.entries(preferences)
      .map(([name, value]) => `user_pref(${JSON.stringify(name)}, ${JSON.stringify(value)});\n`)
      .join(''),
  );
  const display = await openDisplay();
  const firefox = new Process(
    'firefox',
    EXECUTABLE,
    [
      ...['--headless', '--no-remote', '--profile', profile, '--remote-debugging-port', '0'],
      '--remote-allow-system-access', // for its preferences
    ],
    { group: true, env: { ...display.env, HOME: profile, MOZ_CRASHREPORTER_DISABLE: '1' } },
  );
  const close = async (): Promise<void> => {
    await firefox.stop();
    await display.close();
    rmSync(profile, { recursive: true, force: true, maxRetries: 3 });
  };
  try {
    const [, url] = await firefox.line(/WebDriver BiDi listening on (ws:\S+)/);
    const connection = await BidiConnection.open(`${url}/session`);
    const { capabilities } = await connection.send<{ capabilities: { browserVersion: string } }>(
      'session.new',
      {
        capabilities: {},
      },
    );
    await connection.send('session.subscribe', { events: ['log.entryAdded'] });
    return {
      engine: 'firefox',
      version: capabilities.browserVersion,
      lacks: LACKS,
      newPage: (pageOptions) => newPage(connection, pageOptions),
      close: async () => {
        connection.close();
        await close();
      },
    };
  } catch (cause) {
    await close();
    throw cause;
  }
}

/** Preferences apply to the whole browser: they hold for every page until the next one is opened. */
async function prefer(
  connection: BidiConnection,
  preferences: Readonly<Record<string, number>>,
): Promise<void> {
  const { contexts } = await connection.send<{ contexts: readonly { context: string }[] }>(
    'browsingContext.getTree',
    { 'moz:scope': 'chrome' },
  );
  const expression = Object.entries(preferences)
    .map(([name, value]) => `Services.prefs.setIntPref(${JSON.stringify(name)}, ${value});`)
    .join('');
  const [window] = contexts;
  await connection.send('script.evaluate', { expression, target: window, awaitPromise: false });
}

/** A page with its own user context, and so with its own storage, caches and proxy. */
async function newPage(connection: BidiConnection, options: PageOptions = {}): Promise<Page> {
  const complaints = new Complaints(...NETWORK_LOG);
  const proxy = await WatchingProxy.open({ onReport: (text) => complaints.add(text) });
  await prefer(connection, mediaPreferences(options.media));
  const address = `127.0.0.1:${proxy.port}`;
  const { userContext } = await connection.send<{ userContext: string }>('browser.createUserContext', {
    proxy: { proxyType: 'manual', httpProxy: address, sslProxy: address },
  });
  const { context } = await connection.send<{ context: string }>('browsingContext.create', {
    type: 'window', // a tab behind another one would be a hidden page
    userContext,
  });
  connection.onEvent((method, params) => {
    if (method !== 'log.entryAdded') return;
    const entry = params as LogEntry;
    if (entry.level === 'error' && entry.source.context === context) {
      complaints.add(entry.type === 'javascript' ? `uncaught: ${entry.text}` : (entry.text ?? ''));
    }
  });
  if (options.preload !== undefined) {
    const functionDeclaration = `() => { ${options.preload} }`;
    await connection.send('script.addPreloadScript', { functionDeclaration, contexts: [context] });
  }
  const end = new FirefoxEnd(connection, context, userContext);
  await end.resize(options.viewport ?? { width: 1280, height: 800 });
  return new RemotePage(end, proxy, complaints);
}

interface LogEntry {
  readonly type: string;
  readonly level: string;
  readonly text: string | null;
  readonly source: { readonly context?: string };
}

interface Evaluated {
  readonly type: 'success' | 'exception';
  readonly result?: { readonly type: string; readonly value?: string };
  readonly exceptionDetails?: { readonly text: string };
}

class FirefoxEnd implements RemoteEnd {
  readonly #connection: BidiConnection;
  readonly #context: string;
  readonly #userContext: string;

  constructor(connection: BidiConnection, context: string, userContext: string) {
    this.#connection = connection;
    this.#context = context;
    this.#userContext = userContext;
  }

  async navigate(url: string): Promise<void> {
    await this.#send('browsingContext.navigate', { url, wait: 'interactive' });
  }

  async reload(): Promise<void> {
    await this.#send('browsingContext.reload', { wait: 'interactive' });
  }

  async loaded(): Promise<void> {
    await this.evaluate('document.readyState');
  }

  async evaluate(expression: string): Promise<string | null> {
    const answer = await this.#connection.send<Evaluated>('script.evaluate', {
      expression,
      target: { context: this.#context },
      awaitPromise: true,
      userActivation: true,
    });
    if (answer.type === 'exception') throw new Error(answer.exceptionDetails?.text ?? 'an exception');
    return answer.result?.value ?? null;
  }

  async perform(actions: readonly unknown[]): Promise<void> {
    await this.#send('input.performActions', { actions });
    await this.#send('input.releaseActions');
  }

  async resize(viewport: { width: number; height: number }): Promise<void> {
    await this.#send('browsingContext.setViewport', { viewport });
  }

  async capture(): Promise<Buffer> {
    const { data } = await this.#send<{ data: string }>('browsingContext.captureScreenshot');
    return Buffer.from(data, 'base64');
  }

  async close(): Promise<void> {
    await this.#connection.send('browser.removeUserContext', { userContext: this.#userContext });
  }

  #send<T>(method: string, params: object = {}): Promise<T> {
    return this.#connection.send<T>(method, { context: this.#context, ...params });
  }
}
