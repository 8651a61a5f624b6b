import { expect, it } from 'vitest';
import { CarrierChoice, WITHOUT_MS } from '../src/stream/transport.ts';

it('is a WebSocket, until two have failed; then both by turns', () => {
  const choice = new CarrierChoice(() => 0.5);
  const taken = Array.from({ length: 6 }, (_, i) => {
    const by = choice.next(i * 100);
    choice.failed();
    return by;
  });
  expect(taken).toEqual(['websocket', 'websocket', 'events', 'websocket', 'events', 'websocket']);
});

it('is doubted after five seconds without one, too', () => {
  const choice = new CarrierChoice(() => 0.5);
  choice.next(0);
  expect([WITHOUT_MS - 1, WITHOUT_MS].map((nowMs) => choice.overdue(nowMs))).toEqual([false, true]);
  choice.failed();
  expect(choice.next(WITHOUT_MS)).toBe('events');
  expect(choice.overdue(1e9), 'events have the time of any connection').toBe(false);
});

it('stays with events that have worked, and with a WebSocket that does', () => {
  const choice = new CarrierChoice(() => 0.5);
  for (const nowMs of [0, 1]) {
    choice.next(nowMs);
    choice.failed();
  }
  expect(choice.next(2)).toBe('events');
  choice.worked();
  expect(choice.next(60_000)).toBe('events');
  choice.now = 'websocket'; // one that was tried beside them
  choice.worked();
  expect(choice.next(120_000)).toBe('websocket');
  choice.failed();
  expect(choice.next(120_100)).toBe('websocket');
});
