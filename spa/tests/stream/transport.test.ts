import { expect, it } from 'vitest';
import { TransportChoice, WITHOUT_MS } from '../../src/stream/transport.ts';

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
