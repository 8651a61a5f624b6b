import { parseSchema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { DeviationTable } from '../../../src/twin/overlay/deviations.ts';
import { codesWith, SCHEMA } from '../../rigs/schema.ts';

const COMPLY = 0b10011;

const told = (table: DeviationTable, changed: Parameters<typeof codesWith>[0]) =>
  table.read(codesWith(changed)).map(({ channel }) => channel);

describe('the lens', () => {
  it('sees nothing while every joint is within its tolerance', () => {
    expect(told(new DeviationTable(SCHEMA), { 'ref.RKN': 50, 'ref.LKN': -50 })).toEqual([]);
  });

  it('names the channel, how far it is off, and the joints it moves', () => {
    const [knee, ...more] = new DeviationTable(SCHEMA).read(codesWith({ 'ref.RKN': 500, 'pos.RKN': 290 }));
    expect(more).toEqual([]);
    expect(knee).toMatchObject({ channel: 'RKN', unit: 'rad', compliant: false });
    expect(knee?.error).toBeCloseTo(0.21);
    expect(knee?.joints).toHaveLength(1);
    expect(knee?.joints[0]).toMatchObject({
      joint: 'RKN',
      pos: expect.closeTo(0.29),
      ref: expect.closeTo(0.5),
    });
  });

  it('applies couplings to both: a knee of gain two is off twice as far', () => {
    const [knee] = new DeviationTable(SCHEMA).read(codesWith({ 'ref.LKN': 100 }));
    expect(knee?.joints).toEqual([
      { joint: 'LKN', pos: expect.closeTo(0), ref: expect.closeTo(0.1) },
      { joint: 'knee_left', pos: expect.closeTo(0.5), ref: expect.closeTo(0.7) },
    ]);
  });

  it('keeps a deviation until it is well within the tolerance again', () => {
    const table = new DeviationTable(SCHEMA);
    const seen = [51, 49, 41, 39, 49].map((ref) => told(table, { 'ref.RKN': ref }).length);
    expect(seen).toEqual([1, 1, 1, 0, 0]);
  });

  it('marks a joint that yields on purpose', () => {
    const table = new DeviationTable(SCHEMA);
    expect(table.read(codesWith({ 'ref.RKN': 200, 'flags.RKN': COMPLY }))[0]?.compliant).toBe(true);
    expect(table.read(codesWith({ 'ref.RKN': 200 }))[0]?.compliant).toBe(false);
  });

  it('does not judge a joint without a reading', () => {
    expect(told(new DeviationTable(SCHEMA), { 'ref.RKN': 500, 'pos.RKN': null })).toEqual([]);
    expect(told(new DeviationTable(SCHEMA), { 'ref.RKN': null, 'pos.RKN': 500 })).toEqual([]);
  });

  it('is blind for a robot without ref, and one without tolerances', () => {
    const bare = (fields: readonly string[]) =>
      parseSchema(
        JSON.stringify({
          type: 'schema',
          v: 1,
          robot: 'bare',
          labels: { joint: ['a'] },
          fields: fields.map((name) => ({ name, labels: 'joint', scale: 0.001 })),
        }),
      );
    expect(new DeviationTable(bare(['pos'])).read(Int32Array.of(900))).toEqual([]);
    expect(new DeviationTable(bare(['ref', 'pos'])).read(Int32Array.of(900, 0))).toEqual([]);
  });
});
