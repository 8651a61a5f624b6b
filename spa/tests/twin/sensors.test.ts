import { describe, expect, it } from 'vitest';
import { SensorTable } from '../../src/twin/sensors/sensors.ts';
import { BASE_FIELDS, BASE_LABELS, codesWith, SCHEMA, schemaWith } from '../rigs/schema.ts';

const readingsOf = (changed: Parameters<typeof codesWith>[0] = {}) => {
  const groups = new SensorTable(SCHEMA).read(codesWith(changed));
  return new Map(
    groups.flatMap((group) => group.readings.map((r) => [`${group.title} ${r.name}`, r] as const)),
  );
};

describe('sensors', () => {
  it('are grouped by the place they are mounted at, under its plain name', () => {
    const groups = new SensorTable(SCHEMA).groups;
    expect(groups.map((g) => [g.kind, g.title, g.readings.map((r) => r.name)])).toEqual([
      ['wrench', 'right foot', ['Fz', 'Mx', 'My']],
      ['imu', 'torso', ['roll', 'pitch', 'yaw', 'ωx', 'ωy', 'ωz']],
      ['power', 'Power', ['volt']],
      ['other', 'range', ['front']],
    ]);
  });

  it('tell first where the base is, in metres and as angles', () => {
    const half = Math.round(Math.SQRT1_2 * 1000);
    const schema = schemaWith(
      BASE_LABELS,
      BASE_FIELDS.map(({ unit: _, ...field }) => field),
    );
    const table = new SensorTable(schema, { base: 'Base', power: 'Power' });
    const [group] = table.read(Int32Array.from([1500, -20, 12_340, half, 0, 0, half]));
    expect([group?.kind, group?.title]).toEqual(['base', 'Base']);
    const readings = group!.readings.map(({ name, unit, value }) => [name, unit, value?.toFixed(2)]);
    expect(readings).toEqual([
      ['x', 'm', '1.50'],
      ['y', 'm', '-0.02'],
      ['z', 'm', '12.34'],
      ['roll', 'rad', '0.00'],
      ['pitch', 'rad', '0.00'],
      ['yaw', 'rad', '1.57'],
    ]);
    expect(table.reader('base', 'base.z')?.read(Int32Array.from([0, 0, 2000, 1, 0, 0, 0]))).toBe(2);
  });

  it('leave the joints to the other table', () => {
    const fields = new SensorTable(SCHEMA).groups.flatMap((g) => g.readings.map((r) => r.field));
    for (const joint of ['ref', 'pos', 'cur', 'temp', 'flags']) expect(fields).not.toContain(joint);
  });

  it('leave bits to the alarms: a mask is no number', () => {
    const bits = SCHEMA.fields.filter((f) => f.bits.length > 0).map((f) => f.name);
    expect(bits).not.toEqual([]);
    const fields = new SensorTable(SCHEMA).groups.flatMap((g) => g.readings.map((r) => r.field));
    expect(fields.filter((name) => bits.includes(name))).toEqual([]);
  });

  it('read values in the field’s unit, null where there is no reading', () => {
    const readings = readingsOf({ 'ftf.RF.fz': 120, 'ftm.RF.mx': null, 'volt.main': 960 });
    expect(readings.get('right foot Fz')).toMatchObject({ value: 120, unit: 'N', level: 'ok' });
    expect(readings.get('right foot Mx')?.value).toBeNull();
    expect(readings.get('Power volt')?.value).toBeCloseTo(48);
  });

  it('know their limits', () => {
    expect(readingsOf({ 'ftf.RF.fz': 260 }).get('right foot Fz')?.level).toBe('caution');
    expect(readingsOf({ 'ftf.RF.fz': 501 }).get('right foot Fz')?.level).toBe('fault');
  });

  it('show a quaternion as angles, and none of them when a part has no reading', () => {
    const half = Math.round(Math.SQRT1_2 * 1000);
    const turned = readingsOf({ 'quat.torso.w': half, 'quat.torso.y': half });
    expect(turned.get('torso pitch')?.value).toBeCloseTo(Math.PI / 2, 2);
    const dead = readingsOf({ 'quat.torso.z': null });
    for (const angle of ['roll', 'pitch', 'yaw']) expect(dead.get(`torso ${angle}`)?.value).toBeNull();
    const zero = readingsOf({ 'quat.torso.w': 0 });
    for (const angle of ['roll', 'pitch', 'yaw']) expect(zero.get(`torso ${angle}`)?.value).toBeNull();
  });
});
