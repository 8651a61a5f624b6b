import { parseSchema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import { balanceEn } from '../../../src/app/text/balance/balance_en.ts';
import { moreEn } from '../../../src/app/text/more_en.ts';
import { limitChannels } from '../../../src/twin/alarms/limit_channels.ts';
import { ValueLimits } from '../../../src/twin/limits/limits.ts';
import { type OverlayChoice, OverlayReader } from '../../../src/twin/overlay/reader.ts';
import { positionOf } from '../../rigs/joints.ts';
import { codesWith, SCHEMA } from '../../rigs/schema.ts';

const ALL: OverlayChoice = { shown: 'pos', lens: true, forces: true, level: true, load: 'temp' };
const LIMITS = new ValueLimits(SCHEMA.mapping);
const BARE = parseSchema(
  JSON.stringify({
    type: 'schema',
    v: 1,
    robot: 'r',
    labels: { joint: ['a'] },
    fields: [{ name: 'pos', labels: 'joint' }],
  }),
);

const read = (choice: Partial<OverlayChoice>, changed: Parameters<typeof codesWith>[0] = {}) => {
  const reader = new OverlayReader(SCHEMA);
  const wanted = { ...ALL, ...choice };
  const readings = reader.read(codesWith(changed), LIMITS, wanted);
  return { readings, ghost: reader.ghost(readings, wanted) };
};

describe('the signs of a robot', () => {
  it('are read only as far as they are wanted', () => {
    const { readings } = read({});
    expect(readings.wrenches).toHaveLength(1);
    expect(readings.imus[0]?.site).toBe('torso');
    expect(readings.loads?.size).toBeGreaterThan(0);
    const off = read({ lens: false, forces: false, level: false, load: 'off' }, { 'ref.RKN': 500 });
    expect(off.readings).toMatchObject({ wrenches: [], deviations: [], imus: [], body: null, loads: null });
    expect(off.ghost).toBeNull();
  });

  it('have a ghost of the joints that are off, where the body does not show them', () => {
    const off = { 'ref.RKN': 500, 'pos.RKN': 100 };
    const at = (shown: 'pos' | 'ref') => {
      const { joints, limbs } = read({ shown }, off).ghost!;
      expect(limbs).toEqual(['RKN']);
      expect(positionOf(joints, 'LKN'), 'as in the body').toBeNaN();
      return positionOf(joints, 'RKN');
    };
    expect(at('pos')).toBeCloseTo(0.5);
    expect(at('ref')).toBeCloseTo(0.1);
    expect(read({ shown: 'both' }, off).ghost, 'the whole one is shown anyway').toBeNull();
    expect(read({}, { ...off, 'flags.RKN': 0b10011 }).ghost, 'it yields on purpose').toBeNull();
  });

  it('say what can be offered: nothing of a robot that only says where its joints are', () => {
    expect(new OverlayReader(SCHEMA).can).toEqual({
      forces: true,
      level: true,
      lens: true,
      loads: ['cur', 'temp'],
    });
    const bare = new OverlayReader(BARE);
    expect(bare.can).toEqual({ forces: false, level: false, lens: false, loads: [] });
    expect(bare.read(Int32Array.of(1), new ValueLimits(BARE.mapping), ALL).loads).toBeNull();
  });
});

describe('what limits can be set for', () => {
  it('is forces and moments place by place, and load of all joints', () => {
    const groups = limitChannels(SCHEMA, moreEn);
    expect(groups.map(({ title, channels }) => [title, channels.map(({ label }) => label)])).toEqual([
      ['right foot', ['RF.fz', 'RF.mx', 'RF.my']],
      ['Power', ['main']],
      ['Motors', ['*', '*']],
    ]);
    expect(groups[0]?.channels[0]?.span, 'room beyond the limit').toBe(750);
    expect(limitChannels(BARE, moreEn, balanceEn)).toMatchObject([
      { title: 'Balance', channels: [{ field: 'balance', label: 'margin', unit: 'mm', span: 100 }] },
    ]);
    expect(limitChannels(BARE, moreEn)).toEqual([]);
  });
});
