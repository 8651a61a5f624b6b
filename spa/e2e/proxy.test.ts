import net from 'node:net';
import { setTimeout as pause } from 'node:timers/promises';
import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { FaultyLink } from './proxy.ts';

/** A clock that the test advances while somebody waits on it. */
class Hand {
  nowMs = 0;
  #waiting: { atMs: number; go: () => void }[] = [];
  readonly clock = {
    nowMs: () => this.nowMs,
    wait: (ms: number) =>
      ms <= 0
        ? Promise.resolve()
        : new Promise<void>((go) => this.#waiting.push({ atMs: this.nowMs + ms, go })),
  };

  pass(ms: number): void {
    if (this.#waiting.length === 0) return;
    this.nowMs += ms;
    const due = this.#waiting.filter(({ atMs }) => atMs <= this.nowMs);
    this.#waiting = this.#waiting.filter(({ atMs }) => atMs > this.nowMs);
    for (const { go } of due) go();
  }
}

/** A server that echoes; a client that counts. */
describe('the faulty link', () => {
  let server: net.Server;
  let link: FaultyLink;
  let hand: Hand;
  const clients: net.Socket[] = [];

  beforeEach(async () => {
    server = net.createServer((socket) => socket.on('error', () => undefined).pipe(socket));
    await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
    hand = new Hand();
    link = await FaultyLink.open((server.address() as net.AddressInfo).port, hand.clock);
  });
  afterEach(async () => {
    for (const client of clients.splice(0)) client.destroy();
    await link.close();
    server.close();
  });

  function client(): { socket: net.Socket; got: () => number; ended: () => boolean } {
    const socket = net.connect({ port: link.port, host: '127.0.0.1' });
    clients.push(socket);
    let bytes = 0;
    let ended = false;
    socket.on('data', (chunk) => {
      bytes += chunk.length;
    });
    socket.on('error', () => undefined);
    socket.on('close', () => {
      ended = true;
    });
    return { socket, got: () => bytes, ended: () => ended };
  }

  it('passes bytes both ways', async () => {
    const { socket, got } = client();
    socket.write(Buffer.alloc(300_000));
    await until('all of them back', () => got() === 300_000);
  });

  it('cuts, refuses and heals', async () => {
    const first = client();
    first.socket.write('x');
    await until('a byte', () => first.got() === 1);
    link.cut(true);
    await until('the end', () => first.ended());
    const second = client();
    await until('no way in', () => second.ended());
    link.heal();
    const third = client();
    third.socket.write('x');
    await until('a byte', () => third.got() === 1);
  });

  it('freezes: holds connections and bytes, and thaws', async () => {
    const { socket, got, ended } = client();
    link.fault({ frozen: true });
    socket.write('held');
    await pause(300);
    expect(got()).toBe(0);
    expect(ended()).toBe(false);
    link.heal();
    await until('thawed', () => got() === 4);
  });

  it('delays without narrowing', async () => {
    link.fault({ delayMs: 200 });
    const { socket, got } = client();
    socket.write(Buffer.alloc(20_000));
    await until('all', () => {
      if (got() < 20_000) hand.pass(100);
      return got() === 20_000;
    });
    expect(hand.nowMs).toBeGreaterThanOrEqual(800); // the handshake, there and back
    expect(hand.nowMs).toBeLessThan(800 + 20 * 200); // not 200 ms for every slice
  });

  it('narrows towards the browser', async () => {
    link.fault({ bytesPerSecond: 20_000 });
    const { socket, got } = client();
    socket.write(Buffer.alloc(10_000));
    await until('all', () => {
      if (got() < 10_000) hand.pass(10);
      return got() === 10_000;
    });
    expect(hand.nowMs).toBeGreaterThan(400);
  });
});
