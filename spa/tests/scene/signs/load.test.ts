import { describe, expect, it } from 'vitest';
import { Load, LoadTable, loadColor } from '../../../src/scene/signs/load.ts';
import { NO_EDITS, ValueLimits, withEdit } from '../../../src/twin/limits.ts';
import { codesWith, SCHEMA } from '../../rigs/schema.ts';
import { drawnSign, signFrame } from '../../rigs/signs.ts';

const LIMITS = new ValueLimits(SCHEMA.mapping);

describe('load on the body', () => {
  it('is temperature from that of a room to the limit, by URDF joint', () => {
    const loads = new LoadTable(SCHEMA, 'temp').read(codesWith({ 'temp.RKN': 45, 'temp.LKN': 71 }), LIMITS);
    expect(loads.get('RKN')).toMatchObject({ part: expect.closeTo(0.5), level: 'ok' });
    expect(loads.get('LKN')).toMatchObject({ part: 1, level: 'fault' });
    expect(loads.get('knee_left'), 'a coupled joint, too').toMatchObject({ part: 1, level: 'fault' });
  });

  it('has no part where there is no reading, and none below zero', () => {
    const loads = new LoadTable(SCHEMA, 'temp').read(codesWith({ 'temp.RKN': null, 'temp.LKN': 5 }), LIMITS);
    expect(loads.get('RKN')).toEqual({ part: null, level: 'ok' });
    expect(loads.get('LKN')?.part).toBe(0);
  });

  it('goes up to the largest seen where no limit is known, and says so', () => {
    const table = new LoadTable(SCHEMA, 'cur');
    table.read(codesWith({ 'cur.RKN': -400 }), LIMITS);
    const loads = table.read(codesWith({ 'cur.RKN': 100 }), LIMITS);
    expect(loads.get('RKN')?.part).toBeCloseTo(0.25);
    expect(table.scale(LIMITS)).toMatchObject({ full: expect.closeTo(4), limited: false, unit: 'A' });
  });

  it('is measured on both sides: −6 A of a limit of ±12 A is one half', () => {
    const limits = new ValueLimits(
      SCHEMA.mapping,
      withEdit(NO_EDITS, 'cur', 'RKN', { low: -12, high: 12, caution: 0.6 }),
    );
    const table = new LoadTable(SCHEMA, 'cur');
    expect(table.read(codesWith({ 'cur.RKN': -600 }), limits).get('RKN')?.part).toBeCloseTo(0.5);
    expect(table.read(codesWith({ 'cur.RKN': -730 }), limits).get('RKN')?.level).toBe('caution');
    expect(table.scale(limits)).toMatchObject({ full: 12, limited: true, cautionPart: expect.closeTo(0.6) });
  });

  it('has one scale in parts of each limit where limits differ', () => {
    const limits = new ValueLimits(
      SCHEMA.mapping,
      withEdit(NO_EDITS, 'temp', 'RKN', { low: null, high: 90, caution: 0.8 }),
    );
    expect(new LoadTable(SCHEMA, 'temp').scale(limits)).toMatchObject({ full: null, limited: true });
    expect(new LoadTable(SCHEMA, 'temp').scale(LIMITS)).toMatchObject({
      full: 70,
      rest: 20,
      cautionPart: expect.closeTo(0.72),
    });
  });
});

describe('the colours of load', () => {
  it('are those of what a joint moves, and of what hangs on that; past the limit hatched', () => {
    const { sign, picture } = drawnSign(Load, signFrame({ 'temp.knee': 71 }, { settings: { load: 'temp' } }));
    const { fault } = picture.colors;
    expect(picture.tints.get('shank')).toEqual({ color: fault, hatched: true });
    expect(picture.tints.get('foot'), 'fixed to the shank').toEqual({ color: fault, hatched: true });
    expect(picture.tints.get('thigh'), 'no reading').toEqual({ color: 0x7f8894, hatched: false });
    expect(sign.drawn.thigh).toBe('#7f8894');
    expect(sign.scale).toMatchObject({ field: 'temp', full: 70 });
  });

  it('gets darker all the way, so that an eye without colours sees the order', () => {
    const luma = (hex: number) => 0.2126 * (hex >> 16) + 0.7152 * ((hex >> 8) & 255) + 0.0722 * (hex & 255);
    const steps = Array.from({ length: 21 }, (_, i) => luma(loadColor(i / 20)));
    expect(steps.every((bright, i) => i === 0 || bright < steps[i - 1]!)).toBe(true);
    expect(loadColor(-1)).toBe(loadColor(0));
    expect(loadColor(2)).toBe(loadColor(1));
  });
});
