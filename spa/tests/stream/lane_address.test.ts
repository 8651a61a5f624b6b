import { encodeSegment } from '@posecast/wire';
import { expect, it } from 'vitest';
import { readBeginning, readNext } from '../../src/stream/lane/answers.ts';
import { Lane } from '../../src/stream/lane/lane.ts';
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
