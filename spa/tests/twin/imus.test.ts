import type { Schema } from '@posecast/wire';
import { describe, expect, it } from 'vitest';
import {
  IDENTITY,
  invertQuat,
  multiplyQuats,
  normalizeQuat,
  type Quat,
  quatOfRpy,
  rotateVector,
  rpyOf,
  withoutHeading,
} from '../../src/twin/rotation.ts';
import { ImuTable, leanOf, rootAttitude } from '../../src/twin/sensors/imus.ts';
import { codesWith, SCHEMA, schemaWith } from '../rigs/schema.ts';

function schemaOf(labels: Record<string, string[]>, sensors: Record<string, unknown> = {}): Schema {
  const fields = Object.keys(labels).map((name) => ({ name, labels: name, scale: 0.0001 }));
  return schemaWith(labels, fields, { mapping: { sensors } });
}

const near = (q: Quat | null, expected: Quat) => {
  const sign = q !== null && q[0] * expected[0] < 0 ? -1 : 1; // q and -q are the same rotation
  expect(q?.map((part) => part * sign)).toEqual(expected.map((part) => expect.closeTo(part, 3)));
};

const codesOf = (...values: readonly number[]) =>
  Int32Array.from(values, (value) => Math.round(value * 10_000));
const QUAT = ['torso.w', 'torso.x', 'torso.y', 'torso.z'];
const TORSO = { torso: { kind: 'imu', name: 'chest', link: 'Body_Torso' } };

describe('rotations', () => {
  const some: readonly Quat[] = [
    quatOfRpy([0.3, -0.2, 1.1]),
    quatOfRpy([-1.2, 0.9, -2.7]),
    quatOfRpy([3, 0.1, 0.4]),
    quatOfRpy([0, 1.5, -0.5]),
  ];

  it('obey their laws', () => {
    for (const a of some) {
      near(multiplyQuats(a, invertQuat(a)), IDENTITY);
      near(quatOfRpy(rpyOf(a)), a);
      for (const b of some) {
        for (const [i, part] of rotateVector(multiplyQuats(a, b), [1, 2, 3]).entries()) {
          expect(part).toBeCloseTo(rotateVector(a, rotateVector(b, [1, 2, 3]))[i]!, 9);
        }
      }
    }
  });

  it('turn as fixed axes do: roll 90° takes y up, pitch 90° takes x down', () => {
    expect(rotateVector(quatOfRpy([Math.PI / 2, 0, 0]), [0, 1, 0])).toEqual(
      [0, 0, 1].map((v) => expect.closeTo(v)),
    );
    expect(rotateVector(quatOfRpy([0, Math.PI / 2, 0]), [1, 0, 0])).toEqual(
      [0, 0, -1].map((v) => expect.closeTo(v)),
    );
  });

  it('are made of roll, pitch and yaw about fixed axes: a turn about x, then y, then z', () => {
    const [roll, pitch, yaw] = [-2, 0.9, -3];
    const turns = [quatOfRpy([0, 0, yaw]), quatOfRpy([0, pitch, 0]), quatOfRpy([roll, 0, 0])];
    near(quatOfRpy([roll, pitch, yaw]), turns.reduce(multiplyQuats));
  });

  it('without heading lean as before: up stays where it was in the body', () => {
    for (const q of some) {
      const level = withoutHeading(q);
      const up = rotateVector(invertQuat(q), [0, 0, 1]);
      expect(rotateVector(invertQuat(level), [0, 0, 1])).toEqual(up.map((v) => expect.closeTo(v)));
      expect(Math.abs(level[3])).toBeLessThan(1e-9);
      near(withoutHeading(multiplyQuats(quatOfRpy([0, 0, 0.7]), q)), level);
    }
  });

  it('of length zero are none', () => {
    expect(normalizeQuat([0, 0, 0, 0])).toBeNull();
    expect(normalizeQuat([Number.NaN, 0, 0, 1])).toBeNull();
  });
});

describe('orientation sensors', () => {
  it('are found by their quaternions and tilts, with mount and name', () => {
    const schema = schemaOf(
      { quat: QUAT, tilt: ['torso.roll', 'torso.pitch', 'RF.roll', 'RF.pitch'] },
      TORSO,
    );
    const table = new ImuTable(schema);
    expect(table.imus.map(({ site, name, link, heading }) => [site, name, link, heading])).toEqual([
      ['torso', 'chest', 'Body_Torso', true],
      ['RF', 'RF', null, false],
    ]);
    expect(table.body?.site).toBe('torso');
  });

  it('have no reading when a part of it is missing, and when the quaternion is zero', () => {
    const table = new ImuTable(SCHEMA);
    const read = (changed: Parameters<typeof codesWith>[0]) =>
      table.read(codesWith(changed))[0]?.worldFromSensor;
    near(read({}) ?? null, IDENTITY);
    expect(read({ 'quat.torso.x': null })).toBeNull();
    expect(read({ 'quat.torso.w': 0 })).toBeNull();
    near(read({ 'quat.torso.w': 0, 'quat.torso.z': 3 }) ?? null, [0, 0, 0, 1]);
  });

  it('say nothing of the body where the profile names none as its IMU', () => {
    const foot = { RF: { kind: 'wrench', name: 'right foot', link: 'foot' } };
    expect(new ImuTable(schemaOf({ tilt: ['RF.roll', 'RF.pitch'] }, foot)).body).toBeNull();
    expect(
      new ImuTable(schemaOf({ quat: QUAT })).body?.site,
      'the only one of a robot without a profile',
    ).toBe('torso');
    expect(new ImuTable(schemaOf({ x: ['a'] })).imus).toEqual([]);
  });

  it('lean the robot, seen through their mount and the joints below them', () => {
    const table = new ImuTable(schemaOf({ quat: QUAT }, { torso: { ...TORSO.torso, rpy: [0, 0, Math.PI] } }));
    const worldFromRoot = quatOfRpy([0.1, -0.2, 0.8]);
    const rootFromLink = quatOfRpy([0, 0, 0.5]);
    const reading = multiplyQuats(multiplyQuats(worldFromRoot, rootFromLink), quatOfRpy([0, 0, Math.PI]));
    const [imu] = table.read(codesOf(...reading));
    near(rootAttitude(imu!, rootFromLink), worldFromRoot);
    const lean = leanOf(imu!);
    const [roll, pitch] = rpyOf(multiplyQuats(worldFromRoot, rootFromLink));
    expect(lean?.roll).toBeCloseTo(roll, 3);
    expect(lean?.pitch).toBeCloseTo(pitch, 3);
  });

  it('lean it by roll and pitch alone, facing along x, whatever the waist does', () => {
    const table = new ImuTable(schemaOf({ tilt: ['torso.roll', 'torso.pitch'] }, TORSO));
    const [imu] = table.read(codesOf(0.1, -0.05));
    expect(leanOf(imu!)).toEqual({ roll: expect.closeTo(0.1, 3), pitch: expect.closeTo(-0.05, 3) });
    near(rootAttitude(imu!, IDENTITY), withoutHeading(quatOfRpy([0.1, -0.05, 0])));
    table.read(Int32Array.of(1000, -(2 ** 28)));
    expect(leanOf(imu!)).toBeNull();
    expect(rootAttitude(imu!, IDENTITY)).toBeNull();
  });
});
