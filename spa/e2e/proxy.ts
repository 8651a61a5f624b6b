/**
 * A TCP proxy on loopback whose faults switch while connections stand: the network between a page and the relay.
 * Bytes wait in Node's socket buffers (bounded by pausing the sender), so a fault looks like a network, not like a browser trick.
 */

import net from 'node:net';

export interface Fault {
  /** Hold every byte, keep the connections; new ones are accepted and held as well. */
  readonly frozen?: boolean;
  /** Every byte arrives this much later. */
  readonly delayMs?: number;
  /** Towards the browser, over all connections of this proxy. */
  readonly bytesPerSecond?: number;
}

interface Pair {
  readonly browser: net.Socket;
  readonly relay: net.Socket;
}

const SLICE = 1024;
const HELD_BYTES = 64 * 1024;

export class FaultyLink {
  readonly port: number;
  readonly #server: net.Server;
  readonly #links = new Set<Pair>();
  #fault: Fault = {};
  #refuse = false;
  #freeAt = 0;
  #thaw: (() => void)[] = [];

  private constructor(server: net.Server, port: number) {
    this.#server = server;
    this.port = port;
  }

  /** Listens on a free port of 127.0.0.1 and passes on to `targetPort`. */
  static async open(targetPort: number): Promise<FaultyLink> {
    const server = net.createServer({ pauseOnConnect: true });
    await new Promise<void>((resolve, reject) => {
      server.once('error', reject);
      server.listen(0, '127.0.0.1', resolve);
    });
    const address = server.address();
    if (address === null || typeof address === 'string') throw new Error('the proxy has no port');
    const proxy = new FaultyLink(server, address.port);
    server.on('connection', (socket) => proxy.#accept(socket, targetPort));
    return proxy;
  }

  get url(): string {
    return `http://127.0.0.1:${this.port}`;
  }

  get connections(): number {
    return this.#links.size;
  }

  /** Sets the faults that hold from now on; `{}` heals. */
  fault(fault: Fault): void {
    this.#fault = fault;
    if (fault.frozen !== true) for (const go of this.#thaw.splice(0)) go();
  }

  /** Breaks every connection (RST); with `refuse`, new ones too until `heal`. */
  cut(refuse = false): void {
    this.#refuse = refuse;
    for (const { browser, relay } of this.#links) {
      browser.resetAndDestroy();
      relay.resetAndDestroy();
    }
  }

  heal(): void {
    this.#refuse = false;
    this.fault({});
  }

  async close(): Promise<void> {
    this.cut(true);
    this.fault({});
    await new Promise<void>((resolve) => this.#server.close(() => resolve()));
  }

  #accept(browser: net.Socket, targetPort: number): void {
    browser.on('error', () => undefined); // a reset is what this proxy is for
    if (this.#refuse) {
      browser.resetAndDestroy();
      return;
    }
    const relay = net.connect({ port: targetPort, host: '127.0.0.1' });
    relay.on('error', () => browser.resetAndDestroy());
    const link = { browser, relay };
    this.#links.add(link);
    const gone = (): void => {
      this.#links.delete(link);
    };
    browser.on('close', gone);
    relay.on('close', gone);
    void this.#pump(browser, relay, false);
    void this.#pump(relay, browser, true);
  }

  /** Reads towards a lane of at most `HELD_BYTES`, so a slow or frozen lane pushes back on the sender. */
  async #pump(from: net.Socket, to: net.Socket, limited: boolean): Promise<void> {
    const lane = { held: 0, last: Promise.resolve() };
    try {
      for await (const chunk of from as AsyncIterable<Buffer>) {
        for (let at = 0; at < chunk.length; at += SLICE) {
          const slice = chunk.subarray(at, at + SLICE);
          const due = performance.now() + (this.#fault.delayMs ?? 0);
          lane.held += slice.length;
          lane.last = lane.last.then(async () => {
            await wait(due - performance.now());
            await this.#pass(slice.length, limited);
            if (!to.destroyed && !to.write(slice)) await drained(to);
            lane.held -= slice.length;
          });
          if (lane.held > HELD_BYTES) await lane.last;
        }
      }
      await lane.last;
      to.end();
    } catch {
      to.destroy();
    }
  }

  async #pass(bytes: number, limited: boolean): Promise<void> {
    while (this.#fault.frozen === true) await new Promise<void>((resolve) => this.#thaw.push(resolve));
    const { bytesPerSecond } = this.#fault;
    if (!limited || bytesPerSecond === undefined) return;
    const now = performance.now();
    this.#freeAt = Math.max(now, this.#freeAt) + (bytes / bytesPerSecond) * 1000;
    await wait(this.#freeAt - now);
  }
}

function drained(socket: net.Socket): Promise<void> {
  return new Promise((resolve) => socket.once('drain', resolve).once('close', () => resolve()));
}

function wait(ms: number): Promise<void> {
  return ms > 0 ? new Promise((resolve) => setTimeout(resolve, ms)) : Promise.resolve();
}
