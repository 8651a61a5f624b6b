import { parseSchema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { announcement } from '../../src/app/robot/announcement.ts';
import type { Fault } from '../../src/twin/alarms/fault_log.ts';
import { ValueLimits } from '../../src/twin/limits.ts';

import { quatOfRpy } from '../../src/twin/rotation.ts';
import { ImuTable } from '../../src/twin/sensors/imus.ts';
import { WrenchTable } from '../../src/twin/sensors/wrenches.ts';
import { codesWith, SCHEMA_TEXT } from '../rigs/schema.ts';

const WITH_IMU = JSON.parse(SCHEMA_TEXT) as { mapping: { sensors: Record<string, unknown> } };
WITH_IMU.mapping.sensors.torso = { kind: 'imu', name: 'chest', link: 'torso' };
const SCHEMA = parseSchema(JSON.stringify(WITH_IMU));
const LIMITS = new ValueLimits(SCHEMA.mapping);
const LIVE = { word: 'LIVE', cause: null, overShare: false } as const;

/** A body with this lean, degrees. */
function lean(roll: number, pitch: number): Record<string, number> {
  const [w, x, y, z] = quatOfRpy([(roll * Math.PI) / 180, (pitch * Math.PI) / 180, 0.7]);
  const code = (part: number) => Math.round(part * 1000);
  return {
    'quat.torso.w': code(w),
    'quat.torso.x': code(x),
    'quat.torso.y': code(y),
    'quat.torso.z': code(z),
  };
}

const read = (changed: Parameters<typeof codesWith>[0]) => {
  const [codes, imus] = [codesWith(changed), new ImuTable(SCHEMA)];
  imus.read(codes);
  return { wrenches: new WrenchTable(SCHEMA).read(codes, LIMITS), body: imus.body };
};
const fault = (source: string, clearedMs: number | null = null): Fault => ({
  key: source,
  level: 'fault',
  what: 'flag',
  source,
  words: 'jam',
  firstMs: 0,
  clearedMs,
  acknowledged: false,
});
const say = (changed: Parameters<typeof codesWith>[0], faults: readonly Fault[] = []) =>
  announcement({ name: 'Small', verdict: LIVE, readings: read(changed), faults });

describe('a robot in words', () => {
  it('is how it stands, what presses too hard, and what is faulted', () => {
    expect(say({}).text).toBe('Small: live; upright');
    expect(say({ ...lean(-3, 0.5), 'ftf.RF.fz': 280 }, [fault('LKN'), fault('RKN')]).text).toBe(
      'Small: live; upright, leaning 3° left; right foot 280 N, caution; 2 joints with faults',
    );
    expect(say({ 'ftf.RF.fz': -20 }, [fault('RKN'), fault('LKN', 7)]).text).toBe(
      'Small: live; upright; RKN: jam',
    );
  });

  it('leans to four sides, far from upright, or lies', () => {
    const postures = [lean(4, 1), lean(1, 8), lean(1, -8), lean(0, 40), lean(85, 0)].map(
      (changed) => say(changed).text.split('; ')[1],
    );
    expect(postures).toEqual([
      'upright, leaning 4° right',
      'upright, leaning 8° forward',
      'upright, leaning 8° backward',
      'far from upright, leaning 40° forward',
      'lying, leaning 85° right',
    ]);
  });

  it('says nothing of what it does not know', () => {
    expect(say({ 'quat.torso.w': null }).text).toBe('Small: live');
    expect(announcement({ name: 'Small', verdict: LIVE, readings: null, faults: [] }).text).toBe(
      'Small: live',
    );
    expect(
      announcement({
        name: 'Small',
        verdict: { word: null, cause: null, overShare: false },
        readings: null,
        faults: [],
      }).text,
    ).toBe('');
  });

  it('never tells an old state as the present one', () => {
    const verdict = { word: 'STALE', cause: 'robot silent', overShare: false } as const;
    const told = announcement({
      name: 'Small',
      verdict,
      readings: read(lean(30, 0)),
      faults: [fault('RKN')],
    });
    expect(told.text).toBe('Small: stale, robot silent');
  });

  it('is worth saying again when something has changed, not when a number trembles', () => {
    const gist = (changed: Parameters<typeof codesWith>[0], faults: readonly Fault[] = []) =>
      say(changed, faults).gist;
    expect(gist({ ...lean(3, 0), 'ftf.RF.fz': 280 })).toBe(gist({ ...lean(3.6, 0), 'ftf.RF.fz': 291 }));
    expect(gist(lean(3, 0))).not.toBe(gist(lean(-3, 0)));
    expect(gist({ 'ftf.RF.fz': 280 })).not.toBe(gist({ 'ftf.RF.fz': 520 }));
    expect(gist({}, [fault('RKN')])).not.toBe(gist({}, [fault('LKN')]));
  });

  it('ends with the sentence about its balance, again only in its steps, and not of a robot that is silent', () => {
    const balance = { text: 'The centre of mass is 31 mm inside.', gist: 'balance ok' };
    const input = { name: 'demo', verdict: LIVE, readings: null, faults: [] };
    const said = announcement({ ...input, balance });
    expect(said.text).toBe('demo: live. The centre of mass is 31 mm inside.');
    expect(said.gist).toBe(announcement({ ...input, balance: { ...balance, text: 'now 30 mm' } }).gist);
    expect(said.gist).not.toBe(
      announcement({ ...input, balance: { ...balance, gist: 'balance fault' } }).gist,
    );
    expect(announcement({ ...input, balance: null }).text).toBe('demo: live');
    const silent = { word: 'STALE', cause: 'robot silent', overShare: false } as const;
    expect(announcement({ ...input, verdict: silent, balance }).text).not.toContain('centre');
  });
});
