import { describe, expect, it } from 'vitest';
import { NO_EDITS, ValueLimits, withEdit } from '../../src/twin/limits.ts';
import { WrenchTable } from '../../src/twin/sensors/wrenches.ts';
import { codesWith, SCHEMA, schemaWith } from '../rigs/schema.ts';

const LIMITS = new ValueLimits(SCHEMA.mapping);
const foot = (changed: Parameters<typeof codesWith>[0] = {}, limits = LIMITS) =>
  new WrenchTable(SCHEMA).read(codesWith(changed), limits)[0]!;

describe('wrenches', () => {
  it('are one force and one moment a site, in the sensor’s axes', () => {
    const { site, name, mount, force, moment } = foot({
      'ftf.RF.fz': 240,
      'ftm.RF.mx': 20,
      'ftm.RF.my': -40,
    });
    expect([site, name, mount.link]).toEqual(['RF', 'right foot', 'foot']);
    expect(force).toMatchObject({ vector: [0, 0, 240], axes: [2], level: 'ok', much: 500 });
    expect(moment.vector).toEqual([expect.closeTo(1), expect.closeTo(-2), 0]);
    expect(moment.axes).toEqual([0, 1]);
  });

  it('take their colour from the newest value, two-sided, by the limits of the viewer', () => {
    expect(foot({ 'ftf.RF.fz': 251 }).force.level).toBe('caution');
    expect(foot({ 'ftf.RF.fz': 501 }).force.level).toBe('fault');
    const mine = new ValueLimits(
      SCHEMA.mapping,
      withEdit(NO_EDITS, 'ftf', 'RF.fz', { low: -5, high: 9, caution: 1 }),
    );
    expect(foot({ 'ftf.RF.fz': -6 }, mine).force.level).toBe('fault');
    expect(foot({ 'ftf.RF.fz': 8 }, mine).force.level).toBe('ok');
    expect(foot({}, mine).force.much, 'lengths do not change with it').toBe(500);
  });

  it('do not flicker about a limit', () => {
    const table = new WrenchTable(SCHEMA);
    const levels = [501, 499, 501, 480, 470].map(
      (fz) => table.read(codesWith({ 'ftf.RF.fz': fz }), LIMITS)[0]?.force.level,
    );
    expect(levels).toEqual(['fault', 'fault', 'fault', 'fault', 'caution']);
  });

  it('have no vector while a part has no reading; the other stands', () => {
    const { force, moment } = foot({ 'ftf.RF.fz': 100, 'ftm.RF.mx': null });
    expect(force.vector).toEqual([0, 0, 100]);
    expect(moment).toMatchObject({ vector: null, level: 'ok' });
  });

  it('of a robot without such sensors, or whose profile says not where they sit, are none', () => {
    const schema = schemaWith({ ftf: ['RF.fz'] }, [{ name: 'ftf', labels: 'ftf' }]);
    expect(new WrenchTable(schema).wrenches).toEqual([]);
  });
});
