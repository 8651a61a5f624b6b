import { parseSchema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { Deviations, DeviationTable } from '../../../src/scene/signs/deviations.ts';
import { positionOf } from '../../rigs/joints.ts';
import { codesWith, SCHEMA } from '../../rigs/schema.ts';
import { drawnSign, signFrame } from '../../rigs/signs.ts';

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

describe('a deviation', () => {
  const show = (pos: number | null, ref: number, given: Parameters<typeof signFrame>[1] = {}, comply = 0) => {
    const frame = signFrame({ 'pos.knee': pos, 'ref.knee': ref, 'flags.knee': comply }, given);
    const { sign, picture, strokes } = drawnSign(Deviations, frame);
    return { at: sign.drawn[0]?.at ?? null, labels: sign.labels(picture), strokes };
  };

  it('is an arc about the joint, from where the limb is towards where it should be, with its size in words', () => {
    const { at, labels } = show(0, 400); // a turn about y takes the hanging shank to −x
    expect(at![0]).toBeLessThan(-0.01);
    expect(at![1]).toBeCloseTo(0);
    expect(at![2]).toBeLessThan(0.5);
    expect(show(400, 0).at![0]).toBeGreaterThan(0.01);
    expect(show(400, 0, { settings: { shown: 'ref' } }).at![0]).toBeLessThan(-0.01);
    expect(labels).toMatchObject([
      { key: 'apart-knee', text: 'knee 0.40 rad off', explain: ['signs.ghost'] },
    ]);
    expect(show(0, 400, {}, 1).labels).toMatchObject([
      { text: 'knee compliant', level: 'ok', quiet: true, explain: ['signs.yields'] },
    ]);
    const other = { language: 'ko', nameOf: () => '무릎', settings: { angle: 'deg' } } as const;
    expect(show(0, 400, other).labels[0]?.text).toBe('무릎 22.9 ° 벗어남');
  });

  it('of a joint that the model does not have is not drawn', () => {
    const frame = signFrame(codesWith({ 'ref.RKN': 500 }), { schema: SCHEMA });
    const { sign, picture, strokes } = drawnSign(Deviations, frame);
    expect([sign.drawn[0]?.at, strokes, sign.labels(picture)]).toEqual([null, 0, []]);
  });

  it('has a ghost of the joints that are off, where the body does not show them', () => {
    const off = { 'ref.RKN': 500, 'pos.RKN': 100 };
    const ghost = (shown: 'pos' | 'ref' | 'both', codes: Parameters<typeof codesWith>[0] = off) => {
      const sign = new Deviations(SCHEMA);
      sign.read(signFrame(codesWith(codes), { schema: SCHEMA, settings: { shown } }));
      return sign.ghost;
    };
    for (const [shown, position] of [
      ['pos', 0.5],
      ['ref', 0.1],
    ] as const) {
      const { joints, limbs } = ghost(shown)!;
      expect(limbs).toEqual(['RKN']);
      expect(positionOf(joints, 'RKN')).toBeCloseTo(position);
      expect(positionOf(joints, 'LKN'), 'as in the body').toBeNaN();
    }
    expect(ghost('both'), 'the whole one is shown anyway').toBeNull();
    expect(ghost('pos', { ...off, 'flags.RKN': COMPLY }), 'it yields on purpose').toBeNull();
    const table = new DeviationTable(SCHEMA);
    const limbs = () => table.ghost(table.read(codesWith(off)), 'pos')?.limbs;
    expect(limbs(), 'the same joints').toBe(limbs());
  });
});
