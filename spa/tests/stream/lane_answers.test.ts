import { encodeSegment } from '@posecast/wire';
import { expect, it } from 'vitest';
import { readBeginning, readNext } from '../../src/stream/lane/answers.ts';
import { Lane, type LaneAction } from '../../src/stream/lane/lane.ts';
import { readLaneAddress } from '../../src/stream/lane/open_lane.ts';
import { LaneRelay } from '../rigs/lane_relay.ts';

const STREAM = 'wss://relay.example/base/api/v1/robots/demo/live';
const PAST = 'https://relay.example/base/api/v1/robots/demo/past';

it('reads the lane that a relay names, beside the stream', () => {
  expect(readLaneAddress('past/public', STREAM)).toEqual({ pastUrl: PAST, robot: 'demo', view: 'public' });
  expect(readLaneAddress(`${PAST}/slow-view`, STREAM)).toEqual({
    pastUrl: PAST,
    robot: 'demo',
    view: 'slow-view',
  });
  expect(readLaneAddress('past/public?token=x#y', STREAM)).toEqual({
    pastUrl: PAST,
    robot: 'demo',
    view: 'public',
  });
});

it.each([
  'https://elsewhere.example/base/api/v1/robots/demo/past/public',
  '//elsewhere.example/past/public',
  'http://relay.example/base/api/v1/robots/demo/past/public',
  '../other/past/public',
  'past/../../other/past/public',
  'past/%2e%2e/%2e%2e/other/past/public',
  'past',
  'past/',
  'past/a/b',
  'past//relay.example/base/api/v1/robots/demo/past',
  'past/Public',
  'javascript:past/public',
  'https://[',
])('takes no lane that lies elsewhere: %s', (lane) => {
  expect(readLaneAddress(lane, STREAM)).toBeNull();
});

it('takes a lane that the page was told wherever it is', () => {
  const pastUrl = 'https://cdn.example/api/v1/robots/demo/past';
  expect(readLaneAddress(pastUrl, undefined)).toEqual({ pastUrl, robot: 'demo', view: null });
  expect(readLaneAddress('undefined', undefined)).toBeNull();
});

it('reads what a relay answers, and nothing else', () => {
  const answer = (value: unknown, isJson = true) => {
    const bytes = new TextEncoder().encode(typeof value === 'string' ? value : JSON.stringify(value));
    return { status: 200, isJson, retryMs: null, dateMs: null, bytes };
  };
  const newest = { take: '0a1364173aea1949', index: 7 };
  const told = { view: 'public', past_ms: 1000, delay_ms: 5000, newest };
  const read = { view: 'public', isKept: true, delayMs: 5000, newest };
  expect(readBeginning(answer(told))).toEqual(read);
  expect(readBeginning(answer({ ...told, past_ms: 0 }))?.isKept).toBe(false);
  expect(readBeginning(answer({ ...told, delay_ms: -1 }))?.delayMs).toBe(0);
  for (const wrong of [
    null,
    7,
    { take: newest.take },
    { ...newest, index: -1 },
    { ...newest, index: 0.5 },
    { ...newest, take: '../../x' },
  ])
    expect(readBeginning(answer({ ...told, newest: wrong }))?.newest).toBeNull();
  for (const wrong of [{ ...told, view: '../x' }, { ...told, past_ms: '1' }, [], 'null', '{', '7'])
    expect(readBeginning(answer(wrong))).toBeNull();
  expect(readBeginning(answer(told, false))).toBeNull();
  expect(readNext(answer({ next: newest }))).toEqual(newest);
  expect(readNext(answer({ next: { take: 'x', index: 0 } }))).toBeNull();
});

it.each([
  ['robot', 'other'],
  ['view', 'staff'],
  ['take', 'b'.repeat(16)],
  ['index', 8],
])('takes a part for damaged that names another %s than was asked for', (member, other) => {
  const asked = { robot: 'small', view: 'public', take: 'a'.repeat(16), index: 7 };
  const play = (named: object) => {
    const before = { frame: null, event: null, faults: [] };
    const lane = new Lane({ robot: 'small', view: null, hz: 30, isVisible: true, before, random: () => 0 });
    const { segment } = new LaneRelay({ lastsMs: 20_000, keyMs: 4000 }).parts[1]!;
    lane.start(0);
    const newest = { take: asked.take, index: asked.index };
    const told = { view: 'public', past_ms: 1000, delay_ms: 0, newest };
    const answer = { status: 200, retryMs: null, dateMs: null };
    lane.answered(0, { ...answer, isJson: true, bytes: new TextEncoder().encode(JSON.stringify(told)) });
    const start = { ...segment.start, ...asked, ...named };
    const done = lane.answered(0, { ...answer, isJson: false, bytes: encodeSegment({ ...segment, start }) });
    return done.flatMap((action) => (action.do === 'ask' ? [action.path] : []))[0];
  };
  expect(play({}), 'its schema is wanted').toContain('/schema/');
  expect(play({ [member]: other })).toBe(`/public/${asked.take}/8`);
});

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
