import { expect, it } from 'vitest';
import { unreadWords } from '../../src/app/robot/BodyNotes.tsx';
import { LostReadings } from '../../src/twin/sensors/last_readings.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

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
