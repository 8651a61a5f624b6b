import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { TransportChoice, tryWebSocket, WITHOUT_MS } from '../../src/stream/transport.ts';

it('is a WebSocket, until two have failed; then both by turns', () => {
  const choice = new TransportChoice(() => 0.5);
  const taken = Array.from({ length: 6 }, (_, i) => {
    const by = choice.chooseNext(i * 100);
    choice.recordFailure(0);
    return by;
  });
  expect(taken).toEqual(['websocket', 'websocket', 'events', 'websocket', 'events', 'websocket']);
});

it('is doubted after five seconds without one, too', () => {
  const choice = new TransportChoice(() => 0.5);
  choice.chooseNext(0);
  expect([WITHOUT_MS - 1, WITHOUT_MS].map((nowMs) => choice.isOverdue(nowMs))).toEqual([false, true]);
  choice.recordFailure(0);
  expect(choice.chooseNext(WITHOUT_MS)).toBe('events');
  expect(choice.isOverdue(1e9), 'events have the time of any connection').toBe(false);
});

it('stays with events that have worked, and with a WebSocket that does', () => {
  const choice = new TransportChoice(() => 0.5);
  for (const nowMs of [0, 1]) {
    choice.chooseNext(nowMs);
    choice.recordFailure(0);
  }
  expect(choice.chooseNext(2)).toBe('events');
  choice.recordSuccess();
  expect(choice.chooseNext(60_000)).toBe('events');
  choice.now = 'websocket'; // one that was tried in parallel
  choice.recordSuccess();
  expect(choice.chooseNext(120_000)).toBe('websocket');
  choice.recordFailure(0);
  expect(choice.chooseNext(120_100)).toBe('websocket');
});

/** Replaces the browser's WebSocket; simulates the relay's messages. */
class FakeSocket {
  static newest: FakeSocket;
  readonly sent: string[] = [];
  closes = 0;
  onopen: (() => void) | null = null;
  onmessage: ((event: { readonly data: unknown }) => void) | null = null;

  constructor(readonly url: string) {
    FakeSocket.newest = this;
  }

  send(text: string): void {
    this.sent.push(text);
  }

  close(): void {
    this.closes += 1;
  }
}

function attempt(token?: string) {
  const [accepted, refused] = [vi.fn(), vi.fn()];
  const tried = tryWebSocket('ws://relay/live', token, accepted, refused);
  const socket = FakeSocket.newest;
  const say = (data: unknown) =>
    socket.onmessage?.({ data: typeof data === 'object' ? JSON.stringify(data) : data });
  return { accepted, refused, tried, socket, say };
}

beforeEach(() => vi.stubGlobal('WebSocket', FakeSocket));
afterEach(() => vi.unstubAllGlobals());

it('is accepted with the first status, and hands over what was said before', () => {
  const { accepted, refused, tried, socket, say } = attempt();
  socket.onopen?.();
  expect(socket.sent).toEqual([]);
  say({ type: 'hello' });
  expect(accepted).not.toHaveBeenCalled();
  say({ type: 'status' });
  expect(accepted).toHaveBeenCalledOnce();
  const [by, heard] = accepted.mock.calls[0]!;
  expect(by).toBe(tried);
  expect(heard.map(({ data }: { data: string }) => JSON.parse(data).type)).toEqual(['hello', 'status']);
  expect(refused).not.toHaveBeenCalled();
});

it('sends a token first', () => {
  const { socket } = attempt('T');
  socket.onopen?.();
  expect(socket.sent.map((text) => JSON.parse(text))).toEqual([{ type: 'auth', token: 'T' }]);
});

it('is refused with the wait that the relay asks for, and with none that is no wait', () => {
  const { accepted, refused, say } = attempt();
  for (const retry_s of [null, 'soon', -1, 0, 1e300]) say({ type: 'bye', code: 1013, retry_s });
  say({ type: 'hello', retry_s: 5 });
  expect(refused).not.toHaveBeenCalled();
  say({ type: 'bye', code: 1013, retry_s: 600, lane: 'past/public' });
  expect(refused.mock.calls).toEqual([[600]]);
  expect(accepted).not.toHaveBeenCalled();
});

it('is left when it says much and no status, or nothing that can be read', () => {
  const { accepted, socket, say } = attempt();
  for (const data of ['', 'null', '{', '[]', new ArrayBuffer(8)]) socket.onmessage?.({ data });
  for (let i = 0; i < 5; i++) say({ type: 'hello' });
  expect(socket.closes).toBe(0);
  say({ type: 'hello' });
  expect(socket.closes).toBe(1);
  expect(accepted).not.toHaveBeenCalled();
});
