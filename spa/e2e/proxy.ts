/**
 * A TCP proxy on loopback whose faults can be switched while connections are open: the network between a page and the relay.
 * Bytes wait in Node's socket buffers (bounded by pausing the sender), so a fault looks like a real network.
 */

import net from 'node:net';

export interface Fault {
  /** Hold every byte, keep the connections; new ones are accepted and held as well. */
  readonly frozen?: boolean;
  /** Every byte is delayed by this much; the first byte of a connection by one more round trip, its handshake. */
  readonly delayMs?: number;
  /** Bytes of a robot's stream towards the browser are delayed by this much, but no answers to other requests: like a proxy that
   *  scans what does not end. */
  readonly streamDelayMs?: number;
  /** Random jitter: bytes keep their order, as in TCP. */
  readonly jitterMs?: number;
  /** Towards the browser, over all connections of this proxy. */
  readonly bytesPerSecond?: number;
  /** Like old proxies: an upgrade request is passed on as an ordinary request. */
  readonly stripUpgrade?: boolean;
  /** Bytes to the browser are passed on only once this many are there, or the relay has sent everything: like a proxy's
   *  buffer. */
  readonly gatherBytes?: number;
}

/** The clock and timer of the link. */
export interface Clock {
  nowMs(): number;
  wait(ms: number): Promise<void>;
}

const REAL: Clock = {
  nowMs: () => performance.now(),
  wait: (ms) => (ms > 0 ? new Promise((resolve) => setTimeout(resolve, ms)) : Promise.resolve()),
};

interface Pair {
  readonly browser: net.Socket;
  readonly relay: net.Socket;
  stranded: boolean;
  /** A robot's stream was requested on it. */
  streams: boolean;
}

const SLICE = 1024;
const HELD_BYTES = 64 * 1024;
const STREAM = /^GET \S+\/live(?:\.sse)?[? ]/m;
/** Header lines that make a request an upgrade; the key and version of a WebSocket alone don't. */
const UPGRADE = /^(?:Upgrade: websocket|Connection: Upgrade|Connection: keep-alive, Upgrade)\r\n/gim;

export class FaultyLink {
  readonly port: number;
  /** Bytes delivered to the browser so far. */
  passedBytes = 0;
  readonly #server: net.Server;
  readonly #clock: Clock;
  readonly #links = new Set<Pair>();
  /** A browser keeps a connection that the relay has ended, sometimes for a minute. */
  readonly #browsers = new Set<net.Socket>();
  #fault: Fault = {};
  #refuse = false;
  #freeAt = 0;
  #thaw: (() => void)[] = [];

  private constructor(server: net.Server, port: number, clock: Clock) {
    this.#clock = clock;
    this.#server = server;
    this.port = port;
  }

  /** Listens on a free port of 127.0.0.1 and passes on to `targetPort`. */
  static async open(targetPort: number, clock = REAL): Promise<FaultyLink> {
    const server = net.createServer({ pauseOnConnect: true });
    await new Promise<void>((resolve, reject) => {
      server.once('error', reject);
      server.listen(0, '127.0.0.1', resolve);
    });
    const address = server.address();
    if (address === null || typeof address === 'string') throw new Error('the proxy has no port');
    const proxy = new FaultyLink(server, address.port, clock);
    server.on('connection', (socket) => proxy.#accept(socket, targetPort));
    return proxy;
  }

  get url(): string {
    return `http://127.0.0.1:${this.port}`;
  }

  get connections(): number {
    return this.#links.size;
  }

  /** Sets the current faults; `{}` removes them. */
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

  /** From now on every open connection holds its bytes forever, without any notice; new ones work. */
  strand(): void {
    for (const link of this.#links) link.stranded = true;
  }

  heal(): void {
    this.#refuse = false;
    this.fault({});
  }

  async close(): Promise<void> {
    this.cut(true);
    this.fault({});
    for (const browser of this.#browsers) browser.destroy();
    await new Promise<void>((resolve) => this.#server.close(() => resolve()));
  }

  #accept(browser: net.Socket, targetPort: number): void {
    browser.on('error', () => undefined); // resets are the purpose of this proxy
    if (this.#refuse) {
      browser.resetAndDestroy();
      return;
    }
    this.#browsers.add(browser);
    browser.on('close', () => this.#browsers.delete(browser));
    const relay = net.connect({ port: targetPort, host: '127.0.0.1' });
    relay.on('error', () => browser.resetAndDestroy());
    const link = { browser, relay, stranded: false, streams: false };
    this.#links.add(link);
    const gone = (): void => {
      this.#links.delete(link);
    };
    browser.on('close', gone);
    relay.on('close', gone);
    void this.#pump(link, browser, relay, false);
    void this.#pump(link, relay, browser, true);
  }

  /** Reads from a lane of at most `HELD_BYTES`, so that a slow or frozen lane pushes back on the sender. */
  async #pump(link: Pair, from: net.Socket, to: net.Socket, limited: boolean): Promise<void> {
    const lane = { held: 0, last: Promise.resolve() };
    let gathered: Buffer[] = [];
    const opened = this.#clock.nowMs() + (limited ? 0 : 2 * (this.#fault.delayMs ?? 0));
    try {
      for await (const read of from as AsyncIterable<Buffer>) {
        let chunk = read;
        if (!limited) link.streams ||= STREAM.test(read.toString('latin1'));
        if (!limited && this.#fault.stripUpgrade === true) {
          chunk = Buffer.from(read.toString('latin1').replace(UPGRADE, ''), 'latin1');
        }
        if (limited) {
          gathered.push(read);
          chunk = Buffer.concat(gathered);
          if (chunk.length < (this.#fault.gatherBytes ?? 0)) continue;
          gathered = [];
        }
        for (let at = 0; at < chunk.length; at += SLICE) {
          const slice = chunk.subarray(at, at + SLICE);
          const { delayMs = 0, jitterMs = 0, streamDelayMs = 0 } = this.#fault;
          const wanderMs = (2 * Math.random() - 1) * jitterMs;
          const lateMs = delayMs + (limited && link.streams ? streamDelayMs : 0);
          const due = Math.max(this.#clock.nowMs(), opened) + lateMs + wanderMs;
          lane.held += slice.length;
          lane.last = lane.last.then(async () => {
            await this.#clock.wait(due - this.#clock.nowMs());
            await this.#pass(slice.length, limited);
            if (link.stranded) return;
            if (limited) this.passedBytes += slice.length;
            if (!to.destroyed && !to.write(slice)) await drained(to);
            lane.held -= slice.length;
          });
          if (lane.held > HELD_BYTES) await lane.last;
        }
      }
      await lane.last;
      if (link.stranded) return;
      to.end(Buffer.concat(gathered));
    } catch {
      to.destroy();
    }
  }

  async #pass(bytes: number, limited: boolean): Promise<void> {
    while (this.#fault.frozen === true) await new Promise<void>((resolve) => this.#thaw.push(resolve));
    const { bytesPerSecond } = this.#fault;
    if (!limited || bytesPerSecond === undefined) return;
    const now = this.#clock.nowMs();
    this.#freeAt = Math.max(now, this.#freeAt) + (bytes / bytesPerSecond) * 1000;
    await this.#clock.wait(this.#freeAt - now);
  }
}

function drained(socket: net.Socket): Promise<void> {
  return new Promise((resolve) => socket.once('drain', resolve).once('close', () => resolve()));
}
