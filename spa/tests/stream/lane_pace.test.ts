import { expect, it } from 'vitest';
import { Lane, type LaneAction } from '../../src/stream/lane/lane.ts';

it('asks a relay that sends it in circles once a second, after four times at once', () => {
  const before = { frame: null, event: null, faults: [] };
  const lane = new Lane({
    robot: 'small',
    view: 'public',
    hz: 30,
    isVisible: true,
    before,
    random: () => 0.5,
  });
  const takes = ['a'.repeat(16), 'b'.repeat(16)];
  let asked = 0;
  const answer = () => {
    const name = { take: takes[asked % 2], index: 0 };
    const text = JSON.stringify({ view: 'public', past_ms: 1000, delay_ms: 0, newest: name, next: name });
    const bytes = new TextEncoder().encode(text);
    return { status: 200, isJson: true, retryMs: null, dateMs: null, bytes };
  };
  const follow = (nowMs: number, actions: readonly LaneAction[]): void => {
    for (const { do: what } of actions) {
      if (what !== 'ask') continue;
      asked += 1;
      if (asked < 1000) follow(nowMs, lane.answered(nowMs, answer()));
    }
  };
  follow(0, lane.start(0));
  expect(asked).toBe(4);
  for (let nowMs = 250; nowMs <= 20_000; nowMs += 250) follow(nowMs, lane.tick(nowMs));
  expect(asked).toBe(24);
});

it('begins again, and not at once, where a cache names a part as the next after itself', () => {
  const before = { frame: null, event: null, faults: [] };
  const lane = new Lane({
    ...{ robot: 'small', view: 'public', hz: 30, isVisible: true, before },
    random: () => 0.5,
  });
  const name = { take: 'a'.repeat(16), index: 3 };
  const text = JSON.stringify({ view: 'public', past_ms: 1000, delay_ms: 0, newest: name, next: name });
  const answer = {
    status: 200,
    isJson: true,
    retryMs: null,
    dateMs: null,
    bytes: new TextEncoder().encode(text),
  };
  const paths: string[] = [];
  const follow = (nowMs: number, actions: readonly LaneAction[]): void => {
    for (const action of actions) {
      if (action.do !== 'ask') continue;
      paths.push(action.path);
      if (paths.length < 100) follow(nowMs, lane.answered(nowMs, answer));
    }
  };
  follow(0, lane.start(0));
  for (let nowMs = 250; nowMs <= 20_000; nowMs += 250) follow(nowMs, lane.tick(nowMs));
  expect(paths.length).toBeLessThanOrEqual(24);
  const part = `/public/${name.take}/3`;
  expect(paths).toEqual(paths.map((_, i) => (i % 2 === 0 ? '?view=public' : part)));
});

it('ends where the relay refuses, and goes on where only a proxy before it does', () => {
  const before = { frame: null, event: null, faults: [] };
  const ended = (status: number, isJson: boolean) => {
    const lane = new Lane({
      ...{ robot: 'small', view: 'public', hz: 30, isVisible: true, before },
      random: () => 0.5,
    });
    lane.start(0);
    const refusal = { status, isJson, retryMs: null, dateMs: null, bytes: new Uint8Array() };
    return lane.answered(0, refusal).flatMap((action) => (action.do === 'end' ? [action.code] : []));
  };
  expect([401, 403].map((status) => ended(status, true))).toEqual([[4401], [4403]]);
  expect([401, 403].map((status) => ended(status, false))).toEqual([[], []]);
});
