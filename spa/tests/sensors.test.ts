import { describe, expect, it } from 'vitest';
import { eulerOfQuaternion, SensorTable } from '../src/twin/sensors.ts';
import { codesWith, SCHEMA } from './schema.ts';

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

  it('leave the joints to the other table', () => {
    const fields = new SensorTable(SCHEMA).groups.flatMap((g) => g.readings.map((r) => r.field));
    for (const joint of ['ref', 'pos', 'cur', 'temp', 'flags']) expect(fields).not.toContain(joint);
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
  });
});

it('roll, pitch and yaw are about fixed axes: the quaternion made from them gives them back', () => {
  for (const [roll, pitch, yaw] of [
    [0.3, -0.4, 1.2],
    [-2, 0.9, -3],
    [0, 1.5, 0],
  ] as const) {
    const [cr, sr, cp, sp, cy, sy] = [roll, pitch, yaw].flatMap((a) => [
      Math.cos(a / 2),
      Math.sin(a / 2),
    ]) as [number, number, number, number, number, number];
    const [r, p, y] = eulerOfQuaternion(
      cr * cp * cy + sr * sp * sy,
      sr * cp * cy - cr * sp * sy,
      cr * sp * cy + sr * cp * sy,
      cr * cp * sy - sr * sp * cy,
    );
    expect(r).toBeCloseTo(roll);
    expect(p).toBeCloseTo(pitch);
    expect(y).toBeCloseTo(yaw);
  }
  expect(eulerOfQuaternion(0, 0, 0, 0).every(Number.isNaN)).toBe(true);
});
