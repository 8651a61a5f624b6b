/**
 * An HTTP proxy on loopback for all traffic of one page's browser, including loopback. It records every request, lets none leave
 * the machine, and can inject a script before the page's own, for a driver that does not support that.
 */

import { randomUUID } from 'node:crypto';
import http from 'node:http';
import net from 'node:net';
import type { Duplex } from 'node:stream';

export interface WatchingProxyOptions {
  /** Runs in every HTML document before its own scripts; `postDriver(text)` there is `onReport` here. */
  readonly preload?: string;
  readonly onReport: (text: string) => void;
}

const REPORT_BYTES = 16 * 1024;
/** An unused connection is closed after this time: before the relay does, which would break a request on its way. */
const IDLE_MS = 3000;

export class WatchingProxy {
  /** Requested addresses, oldest first; for a tunnel (WebSocket) only its host is known. */
  readonly requested: string[] = [];
  readonly port: number;
  readonly #server: http.Server;
  readonly #options: WatchingProxyOptions;
  readonly #own = `/${randomUUID()}`;
  readonly #tunnels = new Set<Duplex>();
  /** Keeps connections, as the browser would by itself: on a slow network a new one costs a second round trip. */
  readonly #agent = new http.Agent({ keepAlive: true, timeout: IDLE_MS });

  private constructor(server: http.Server, port: number, options: WatchingProxyOptions) {
    this.#server = server;
    this.port = port;
    this.#options = options;
  }

  /** Listens on a free port of 127.0.0.1. */
  static async open(options: WatchingProxyOptions): Promise<WatchingProxy> {
    const server = http.createServer();
    await new Promise<void>((resolve, reject) => {
      server.once('error', reject);
      server.listen(0, '127.0.0.1', resolve);
    });
    const address = server.address();
    if (address === null || typeof address === 'string') throw new Error('the proxy has no port');
    const proxy = new WatchingProxy(server, address.port, options);
    server.on('request', (request, response) => proxy.#pass(request, response));
    server.on('connect', (request, socket, head) => proxy.#tunnel(request.url ?? '', socket, head));
    server.on('upgrade', (request, socket, head) => proxy.#upgrade(request, socket, head));
    return proxy;
  }

  async close(): Promise<void> {
    if (!this.#server.listening) return;
    for (const socket of this.#tunnels) socket.destroy();
    this.#agent.destroy();
    this.#server.closeAllConnections();
    await new Promise<void>((resolve) => this.#server.close(() => resolve()));
  }

  #pass(request: http.IncomingMessage, response: http.ServerResponse): void {
    const url = new URL(request.url ?? '', 'http://proxy.invalid');
    if (url.pathname === this.#own) {
      this.#serveOwn(request, response);
      return;
    }
    this.requested.push(url.href);
    if (!isLoopback(url.hostname)) {
      response.writeHead(502).end();
      return;
    }
    const html = this.#options.preload !== undefined && (request.headers.accept ?? '').includes('text/html');
    const headers = { ...request.headers, ...(html ? { 'accept-encoding': 'identity' } : {}) };
    const onward = http.request(
      url,
      { method: request.method ?? 'GET', headers, agent: this.#agent },
      (answer) => {
        const status = answer.statusCode ?? 502;
        if (status >= 400) {
          // in Chromium's words, so that one `forgive` works for every engine
          this.#options.onReport(
            `Failed to load resource: the server responded with a status of ${status} (${answer.statusMessage})`,
          );
        }
        if (html && (answer.headers['content-type'] ?? '').startsWith('text/html')) {
          this.#inject(answer, response);
          return;
        }
        response.writeHead(status, answer.headers);
        answer.pipe(response);
        answer.on('error', () => response.destroy());
      },
    );
    onward.on('error', () => response.destroy()); // simulates a failing network, not an answer
    response.on('close', () => onward.destroy());
    request.pipe(onward);
  }

  /** The preload script, and the receiver of its reports. */
  #serveOwn(request: http.IncomingMessage, response: http.ServerResponse): void {
    if (request.method !== 'POST') {
      response.writeHead(200, { 'content-type': 'text/javascript', 'cache-control': 'no-store' });
      response.end(
        `globalThis.postDriver = (text) => fetch('${this.#own}', { method: 'POST', body: text, keepalive: true });
        ${this.#options.preload}`,
      );
      return;
    }
    let text = '';
    request.setEncoding('utf8');
    request.on('data', (part: string) => {
      text = (text + part).slice(0, REPORT_BYTES);
    });
    request.on('end', () => {
      this.#options.onReport(text);
      response.writeHead(204).end();
    });
  }

  #inject(answer: http.IncomingMessage, response: http.ServerResponse): void {
    const parts: Buffer[] = [];
    answer.on('data', (part: Buffer) => parts.push(part));
    answer.on('error', () => response.destroy());
    answer.on('end', () => {
      const script = `<script src="${this.#own}"></script>`;
      const page = Buffer.concat(parts).toString();
      const body = /<head>/i.test(page)
        ? page.replace(/<head>/i, (head) => head + script)
        : page.replace(/^(\s*<!doctype[^>]*>)?/i, (start) => start + script);
      const { 'content-length': _, ...headers } = answer.headers;
      response.writeHead(answer.statusCode ?? 502, headers);
      response.end(body);
    });
  }

  #tunnel(authority: string, browser: Duplex, head: Buffer): void {
    this.requested.push(`ws://${authority}/`);
    const [host = '', port = '0'] = authority.split(':');
    if (!isLoopback(host)) {
      browser.end('HTTP/1.1 502 Bad Gateway\r\n\r\n');
      return;
    }
    const onward = net.connect({ host, port: Number(port) }, () => {
      browser.write('HTTP/1.1 200 Connection established\r\n\r\n');
      onward.write(head);
    });
    this.#join(browser, onward);
  }

  #upgrade(request: http.IncomingMessage, browser: Duplex, head: Buffer): void {
    const url = new URL(request.url ?? '');
    this.requested.push(url.href.replace(/^http/, 'ws'));
    if (!isLoopback(url.hostname)) {
      browser.end('HTTP/1.1 502 Bad Gateway\r\n\r\n');
      return;
    }
    const lines = [`GET ${url.pathname}${url.search} HTTP/1.1`];
    for (let i = 0; i + 1 < request.rawHeaders.length; i += 2) {
      lines.push(`${request.rawHeaders[i]}: ${request.rawHeaders[i + 1]}`);
    }
    const onward = net.connect({ host: url.hostname, port: Number(url.port) }, () => {
      onward.write(`${lines.join('\r\n')}\r\n\r\n`);
      onward.write(head);
    });
    this.#join(browser, onward);
  }

  /** If one side ends or breaks, so does the other. */
  #join(browser: Duplex, onward: net.Socket): void {
    this.#tunnels.add(browser);
    browser.pipe(onward).pipe(browser);
    browser.on('error', () => undefined).on('close', () => onward.destroy());
    onward.on('error', () => undefined);
    onward.on('close', () => {
      this.#tunnels.delete(browser);
      browser.destroy();
    });
  }
}

function isLoopback(host: string): boolean {
  return host === '127.0.0.1' || host === 'localhost' || host === '[::1]';
}
