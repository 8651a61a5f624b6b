import { parseSchema } from '@posecast/wire';
import { describe, expect, it, vi } from 'vitest';
import { poseDiffers } from '../../src/stream/frame_reader.ts';
import { NO_EDITS, withEdit } from '../../src/twin/limits.ts';
import { judge } from '../../src/twin/liveness.ts';
import { Poser } from '../../src/twin/playback/pose.ts';
import { EVENT_LIMIT, type RobotState, RobotTwin } from '../../src/twin/robot.ts';
import { positionOf } from '../rigs/joints.ts';
import {
  BASE_FIELDS,
  BASE_LABELS,
  codesWith,
  SCHEMA,
  SCHEMA_TEXT,
  schemaWith,
  stateAt,
} from '../rigs/schema.ts';

const OTHER = parseSchema(SCHEMA_TEXT.replace('"Small"', '"Other"'));

function state(changed: Partial<RobotState> = {}): RobotState {
  const codes = codesWith({ 'pos.RKN': 480, 'cur.RKN': null });
  return stateAt(1000, codes, { seq: 7, freshMs: 900, bornMs: 900, changedMs: 800, ...changed });
}

const event = (n: number, at = n) =>
  ({ type: 'event', n, t: n, at, level: 'fault', source: 'RKN', text: 'jam', state: 'on' }) as const;

describe('twin', () => {
  it('gives values by field and label: a number, null for no reading, undefined for no such channel', () => {
    const twin = new RobotTwin('small', 0);
    expect(twin.value('pos', 'RKN')).toBeUndefined();
    twin.acceptSchema(SCHEMA);
    expect(twin.value('pos', 'RKN')).toBeNull();
    twin.acceptState(state());
    expect(twin.value('pos', 'RKN')).toBeCloseTo(0.48);
    expect(twin.value('cur', 'RKN')).toBeNull();
    expect(twin.value('pos', 'nobody')).toBeUndefined();
    expect(twin.value('nothing', 'RKN')).toBeUndefined();
  });

  it('takes the freshness of a state as evidence, and never forgets what was fresher', () => {
    const twin = new RobotTwin('small', 0);
    twin.acceptSchema(SCHEMA);
    twin.acceptState(state());
    expect(twin.evidence).toMatchObject({ freshMs: 900, changedMs: 800, heardMs: 1000 });
    twin.acceptState(state({ freshMs: null, atMs: 900 }));
    expect(twin.evidence).toMatchObject({ freshMs: 900, heardMs: 1000 });
  });

  it('of a page that is hidden nobody says that it stands still, whatever was still under way', () => {
    const twin = new RobotTwin('small', 0);
    twin.acceptSchema(SCHEMA);
    twin.acceptConnection(true, 0);
    twin.acceptWatching(true, 0);
    twin.acceptState(state());
    twin.acceptWatching(false, 1000);
    twin.acceptState(state({ changedMs: 990, atMs: 1010 }));
    for (const atMs of [2000, 6000]) {
      twin.acceptStatus({
        ...{ robot: 'online', ageMs: 20, seq: 99, degraded: false, overShare: false, atMs },
      });
      expect(judge(twin.evidence, atMs + 100)).toMatchObject({ word: 'LIVE', unchangedMs: null });
    }
  });

  it('is only opening while a full relay sends it to its lane, and has lost what it had shown', () => {
    for (const hasShown of [false, true]) {
      const twin = new RobotTwin('small', 0);
      twin.acceptSchema(SCHEMA);
      twin.acceptWatching(true, 0);
      twin.acceptConnection(true, 4000);
      if (hasShown) twin.acceptState(state());
      twin.acceptConnection(false, 5000, true);
      expect(judge(twin.evidence, 7000).word).toBe(hasShown ? 'STALE' : null);
      expect(judge(twin.evidence, 9000), 'not for ever').toMatchObject({ cause: 'no connection' });
    }
    const refused = new RobotTwin('small', 0);
    refused.acceptConnection(true, 100);
    refused.acceptConnection(false, 200);
    expect(judge(refused.evidence, 300), 'a relay without a lane').toMatchObject({ cause: 'no connection' });
  });

  it('takes events of before that are told late, each once and in their order', () => {
    const twin = new RobotTwin('small', 0);
    for (const n of [7, 8]) twin.acceptEvent(event(n));
    twin.acceptEarlier([], false);
    expect(twin.hasAllEvents).toBe(false);
    twin.acceptEvent({ ...event(8.5), state: 'off' }); // reported because nobody had
    twin.acceptEvent(event(10));
    twin.acceptEarlier([event(5), event(6), event(7), event(9)], true);
    expect(twin.events.map(({ n }) => n)).toEqual([5, 6, 7, 8, 9, 10]);
    expect(twin.hasAllEvents).toBe(true);
    twin.acceptEarlier(
      Array.from({ length: 200 }, (_, i) => event(11 + i)),
      true,
    );
    expect(twin.events.length).toBe(EVENT_LIMIT);
  });

  it('drops the old pose with the old schema, and ignores states of another one', () => {
    const twin = new RobotTwin('small', 0);
    twin.acceptSchema(SCHEMA);
    twin.acceptState(state());
    twin.acceptSchema(OTHER);
    expect(twin.state).toBeNull();
    twin.acceptState(state());
    expect(twin.state).toBeNull();
  });

  it('reads the joints of a frame once, however many ask, and again by other limits', () => {
    const twin = new RobotTwin('small', 0);
    expect(twin.joints()).toBeNull();
    twin.acceptSchema(SCHEMA);
    const joints = twin.joints()!;
    const read = vi.spyOn(joints, 'read');
    twin.acceptState(state({ codes: codesWith({ 'cur.RKN': 150 }) }));
    const knee = () => twin.joints()!.rows.find(({ label }) => label === 'RKN');
    expect(knee()).toMatchObject({ levels: { cur: 'ok' } });
    expect(twin.joints()).toBe(joints);
    expect(read).toHaveBeenCalledTimes(1);
    twin.acceptEdits(withEdit(NO_EDITS, 'cur', 'RKN', { low: null, high: 1, caution: 1 }));
    expect(knee()).toMatchObject({ levels: { cur: 'fault' } });
    expect(read).toHaveBeenCalledTimes(2);
    twin.acceptSchema(OTHER);
    expect(twin.joints()).not.toBe(joints);
  });

  it('tells frame listeners of states only, and the others of what seldom changes', () => {
    const twin = new RobotTwin('small', 0);
    const heard: string[] = [];
    const off = twin.onState(() => heard.push('state'));
    twin.onChange(() => heard.push('change'));
    twin.acceptSchema(SCHEMA);
    twin.acceptSchema(SCHEMA);
    twin.acceptState(state());
    twin.acceptModel('a');
    twin.acceptModel('a');
    off();
    twin.acceptState(state());
    expect(heard).toEqual(['change', 'state', 'change']);
  });

  it('a new connection starts without the old one’s status', () => {
    const twin = new RobotTwin('small', 0);
    twin.acceptConnection(true, 10);
    twin.acceptStatus({ robot: 'online', ageMs: 1, seq: 1, degraded: false, overShare: false, atMs: 20 });
    twin.acceptConnection(false, 30);
    expect(twin.evidence).toMatchObject({ connected: false, lostMs: 30 });
    twin.acceptConnection(true, 40);
    expect(twin.evidence).toMatchObject({ connected: true, lostMs: null, status: null });
  });

  it('a picture that nobody fed for a while is forgotten: on a new connection, and on coming back to the page', () => {
    const twin = new RobotTwin('small', 0);
    twin.acceptSchema(SCHEMA);
    twin.acceptConnection(true, 10);
    twin.acceptState(state());
    expect(twin.evidence).toMatchObject({ watchingMs: 10, shownMs: 900, changedMs: 800 });
    twin.acceptConnection(false, 2000);
    twin.acceptConnection(true, 3000);
    expect(twin.evidence).toMatchObject({ watchingMs: 3000, shownMs: null, changedMs: null, freshMs: null });
    twin.acceptWatching(false, 4000);
    expect(twin.evidence).toMatchObject({ watchingMs: null });
    twin.acceptWatching(true, 5000);
    expect(twin.evidence).toMatchObject({ watchingMs: 5000, shownMs: null });
  });
});

describe('events', () => {
  it('are kept once each, the newest hundred', () => {
    const twin = new RobotTwin('small', 0);
    for (let n = 1; n <= 150; n++) twin.acceptEvent(event(n));
    for (let n = 51; n <= 150; n++) twin.acceptEvent(event(n)); // a new connection repeats them
    expect(twin.events.length).toBe(EVENT_LIMIT);
    expect(twin.events.map((e) => e.n)).toEqual(Array.from({ length: 100 }, (_, i) => i + 51));
  });

  it('begin anew when the relay counts anew', () => {
    const twin = new RobotTwin('small', 0);
    for (let n = 1; n <= 5; n++) twin.acceptEvent(event(n));
    twin.acceptEvent(event(1, 999));
    twin.acceptEvent(event(2, 1000));
    expect(twin.events.map((e) => e.at)).toEqual([999, 1000]);
  });
});

describe('pose', () => {
  it('is mapped joints, for pos and ref alike; what has no mapping is itself', () => {
    const codes = codesWith({ 'pos.LKN': 250, 'ref.LKN': 100, 'pos.NK1': 30 });
    const pos = new Poser(SCHEMA, 'pos').pose(codes);
    expect(positionOf(pos.joints, 'knee_left')).toBeCloseTo(1);
    expect(positionOf(pos.joints, 'NK1')).toBeCloseTo(0.03);
    expect(positionOf(new Poser(SCHEMA, 'ref').pose(codes).joints, 'knee_left')).toBeCloseTo(0.7);
    expect(pos.base).toBeNull();
  });

  it('leaves out a joint without a reading', () => {
    const { joints } = new Poser(SCHEMA, 'pos').pose(codesWith({ 'pos.LKN': null }));
    expect(positionOf(joints, 'knee_left')).toBeNaN();
    expect(positionOf(joints, 'RKN')).toBe(0);
  });

  it('has the base that a robot reports, whole or not at all', () => {
    const poser = new Poser(schemaWith(BASE_LABELS, BASE_FIELDS), 'pos');
    const { base } = poser.pose(Int32Array.of(1000, -500, 900, 1000, 0, 0, 0));
    expect(base).toEqual({ xyz: [1, -0.5, 0.9], quat_wxyz: [1, 0, 0, 0] });
    expect(poser.pose(Int32Array.of(1000, -(2 ** 28), 900, 1000, 0, 0, 0)).base).toBeNull();
  });

  it('differs when pos, ref or flags do, and not for the noise of other sensors', () => {
    const before = codesWith();
    expect(poseDiffers(SCHEMA, before, codesWith())).toBe(false);
    expect(poseDiffers(SCHEMA, before, codesWith({ 'cur.RKN': 3, 'gyro.torso.x': 1 }))).toBe(false);
    for (const channel of ['pos.RKN', 'ref.LKN', 'flags.NK1']) {
      expect(poseDiffers(SCHEMA, before, codesWith({ [channel]: 1 }))).toBe(true);
    }
  });
});
