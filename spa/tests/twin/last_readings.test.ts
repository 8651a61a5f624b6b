import { MISSING, parseSchema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { LastReadings } from '../../src/twin/sensors/last_readings.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

const state = (atMs: number, changed: Parameters<typeof codesWith>[0] = {}) => ({
  ...{ schemaId: SCHEMA.id, seq: 1, tS: 0, codes: codesWith(changed), freshMs: 0, bornMs: 0, changedMs: 0 },
  atMs,
});
const force = SCHEMA.field('ftf')!;
const codeOf = (readings: LastReadings) => readings.codes[force.start];

describe('the last readings', () => {
  it('stay when a board falls silent while frames go on, with when they were read', () => {
    const readings = new LastReadings();
    readings.push(SCHEMA, state(100, { 'ftf.RF.fz': 250 }));
    expect([readings.anyLost, readings.lostMs(force, 0)]).toEqual([false, null]);
    readings.push(SCHEMA, state(200, { 'ftf.RF.fz': null }));
    readings.push(SCHEMA, state(5000, { 'ftf.RF.fz': null }));
    expect([readings.anyLost, readings.lostMs(force, 0), codeOf(readings)]).toEqual([true, 100, 250]);
    readings.push(SCHEMA, state(5100, { 'ftf.RF.fz': 0 }));
    expect([readings.anyLost, readings.lostMs(force, 0), codeOf(readings)]).toEqual([false, null, 0]);
  });

  it('say nothing of what was never read, or is no channel', () => {
    const readings = new LastReadings();
    readings.push(SCHEMA, state(100, { 'temp.RKN': null }));
    readings.push(SCHEMA, state(200, { 'temp.RKN': null }));
    expect(readings.anyLost).toBe(false);
    expect(readings.lostMs(SCHEMA.field('temp'), 1)).toBeNull();
    expect([readings.lostMs(null, 0), readings.lostMs(force, -1), readings.lostMs(force, 9)]).toEqual([
      null,
      null,
      null,
    ]);
  });

  it('begin anew with another schema: its channels mean something else', () => {
    const readings = new LastReadings();
    readings.push(SCHEMA, state(100, { 'ftf.RF.fz': 250 }));
    readings.push(SCHEMA, state(200, { 'ftf.RF.fz': null }));
    const other = parseSchema(SCHEMA.text.replace('"Small"', '"Other"'));
    readings.push(other, { ...state(300, { 'ftf.RF.fz': null }), schemaId: other.id });
    expect([readings.anyLost, readings.lostMs(force, 0)]).toEqual([false, null]);
    expect(readings.codes[force.start]).toBe(MISSING);
  });
});
