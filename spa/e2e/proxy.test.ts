import net from 'node:net';
import { setTimeout as pause } from 'node:timers/promises';
import { afterEach, beforeEach, describe, expect, it } from 'vitest';
import { until } from './driver/until.ts';
import { FaultyLink } from './proxy.ts';

/** A server that echoes; a client that counts. */
describe('the faulty link', () => {
  let server: net.Server;
  let link: FaultyLink;
  const clients: net.Socket[] = [];

  beforeEach(async () => {
    server = net.createServer((socket) => socket.on('error', () => undefined).pipe(socket));
    await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
    link = await FaultyLink.open((server.address() as net.AddressInfo).port);
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
    const began = performance.now();
    socket.write(Buffer.alloc(20_000));
    await until('all', () => got() === 20_000);
    const ms = performance.now() - began;
    expect(ms).toBeGreaterThanOrEqual(380); // there and back
    expect(ms).toBeLessThan(1500); // not 200 ms for every slice
  });

  it('narrows towards the browser', async () => {
    link.fault({ bytesPerSecond: 20_000 });
    const { socket, got } = client();
    const began = performance.now();
    socket.write(Buffer.alloc(10_000));
    await until('all', () => got() === 10_000);
    expect(performance.now() - began).toBeGreaterThan(400);
  });
});
