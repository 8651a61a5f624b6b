import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { tryWebSocket } from '../../src/stream/trial.ts';

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
