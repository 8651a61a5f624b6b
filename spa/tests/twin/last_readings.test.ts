import { MISSING, parseSchema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { unmovedWords, unreadWords } from '../../src/app/robot/BodyNotes.tsx';
import { LastReadings, LostReadings } from '../../src/twin/sensors/last_readings.ts';
import { codesWith, SCHEMA, stateAt } from '../rigs/schema.ts';

const state = (atMs: number, changed: Parameters<typeof codesWith>[0] = {}) =>
  stateAt(atMs, codesWith(changed));
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

it('names the joints that have lost their reading, not those that never had one', () => {
  const lost = new LostReadings(SCHEMA);
  expect(lost.update(codesWith({ 'pos.NK1': null }))).toEqual([]);
  expect(lost.update(codesWith({ 'pos.NK1': null, 'pos.RKN': null, 'ref.LKN': null }))).toEqual(['RKN']);
  expect(lost.update(codesWith())).toEqual([]);
  expect(lost.update(codesWith({ 'pos.NK1': null }))).toEqual(['NK1']);
});

it('says so in one short line', () => {
  expect(unreadWords(['RKN'])).toBe('No reading of RKN: shown in its last known position.');
  expect(unreadWords(['A', 'B', 'C', 'D', 'E', 'F'])).toBe(
    'No reading of A, B, C, D and 2 more: shown in their last known positions.',
  );
});

it('names a few readings that move nothing, and a few joints', () => {
  expect(unmovedWords(['r1/a'], ['a', 'b', 'c', 'd'])).toBe(
    'No reading moves this body: the robot reports r1/a, the joints of its model are a, b, c, ….',
  );
});
