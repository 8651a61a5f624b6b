import { describe, expect, test } from 'vitest';
import { JointMapping, level, parseSchema } from '../src/index.ts';
import { load, type Schemas } from './vectors.ts';

const { mapping: vector } = load<Schemas>('vectors/schemas.json');
const schema = parseSchema(vector.text);

describe('joints', () => {
  test.each(Object.entries(vector.joints))('of %s as the vector says', (field, joints) => {
    const mapping = new JointMapping(schema, field);
    const values = mapping.evaluate(Int32Array.from(vector.codes));
    const got = new Map(mapping.joints.map((name, i) => [name, Number.isNaN(values[i]) ? null : values[i]]));
    expect(got).toEqual(new Map(Object.entries(joints)));
  });

  test('the same array each time', () => {
    const mapping = new JointMapping(schema, 'pos');
    const codes = new Int32Array(schema.size);
    expect(mapping.evaluate(codes)).toBe(mapping.evaluate(codes));
  });
});

test('limits: rest lies at zero, or beyond the limit', () => {
  const force = { low: -30, high: 500, caution: 0.5 };
  expect([-31, -30, -15, 0, 250, 251, 501].map((v) => level(force, v))).toEqual([
    'fault',
    'caution',
    'ok',
    'ok',
    'ok',
    'caution',
    'fault',
  ]);
  const battery = { low: 44, high: null, caution: 0.88 };
  expect([43.9, 44, 49.9, 50.1].map((v) => level(battery, v))).toEqual(['fault', 'caution', 'caution', 'ok']);
  expect([null, Number.NaN].map((v) => level(force, v))).toEqual(['ok', 'ok']);
});

test('stars stand for the rest', () => {
  const { mapping } = parseSchema(
    JSON.stringify({
      type: 'schema',
      v: 1,
      robot: 'r',
      labels: { j: ['x'] },
      fields: [{ name: 'a', labels: 'j' }],
      mapping: {
        thresholds: { temp: { '*': { high: 70 }, RKN: { high: 80, caution: 0.9 } } },
        tolerance: { '*': 0.05, RKN: 0.08 },
        severity: { flags: { homed: 'state' } },
        units: { pos: { NK1: 'mm' } },
        names: { RKN: 'right knee', LKN: 'left knee' },
        translated_names: { ko: { RKN: '오른쪽 무릎' }, en: { RKN: 'the right knee', WST: 'waist' } },
        explain: { flags: { jam: { en: { say: '{joint} is stuck.' } } } },
        sensors: { RF: { kind: 'wrench', link: 'foot' }, main: { kind: 'power' } },
      },
    }),
  );
  const named = (language: string) =>
    ['RKN', 'LKN', 'WST', 'x'].map((label) => mapping.name(label, language));
  expect(named('ko')).toEqual(['오른쪽 무릎', 'left knee', 'waist', null]);
  expect(named('en')).toEqual(['the right knee', 'left knee', 'waist', null]);
  expect(named('fa')).toEqual(['right knee', 'left knee', 'waist', null]);
  expect(mapping.threshold('temp', 'RKN')).toEqual({ low: null, high: 80, caution: 0.9 });
  expect(mapping.threshold('temp', 'LKN')).toEqual({ low: null, high: 70, caution: 1 });
  expect(mapping.threshold('cur', 'LKN')).toBeNull();
  expect([mapping.tolerance('RKN'), mapping.tolerance('LKN')]).toEqual([0.08, 0.05]);
  expect([mapping.severity('flags', 'homed'), mapping.severity('flags', 'jam')]).toEqual(['state', 'fault']);
  expect(mapping.sentence('flags', 'jam')).toEqual(
    new Map([['en', { say: '{joint} is stuck.', why: null }]]),
  );
  expect([mapping.sentence('flags', 'homed'), mapping.sentence('a', 'jam')]).toEqual([null, null]);
  expect([mapping.unit('pos', 'NK1'), mapping.unit('pos', 'RKN'), mapping.unit('cur', 'NK1')]).toEqual([
    'mm',
    null,
    null,
  ]);
  expect(mapping.sensors.get('RF')).toEqual({
    kind: 'wrench',
    name: 'RF',
    link: 'foot',
    xyz: [0, 0, 0],
    rpy: [0, 0, 0],
  });
  expect(mapping.sensors.get('main')?.link).toBeNull();
});

test('sentences are as many and as long as the page can take', () => {
  const parsed = (explain: object) =>
    parseSchema(
      JSON.stringify({
        ...{ type: 'schema', v: 1, robot: 'r', labels: { j: ['x'] } },
        ...{ fields: [{ name: 'a', labels: 'j' }], mapping: { explain } },
      }),
    ).mapping;
  const long = { say: '🦾'.repeat(200), why: '🦾'.repeat(200) };
  const full = Object.fromEntries(Array.from({ length: 20 }, (_, n) => [`b${n}`, { en: long }]));
  const most = { a: { ...full, last: { en: { say: '🦾'.repeat(192) } } } };
  expect(() => parsed(most)).not.toThrow();
  expect(() => parsed({ ...most, b: { jam: { en: { say: 'x' } } } })).toThrow(
    'mapping.explain: more than 32768 bytes of sentences in all',
  );
  const languages = (count: number) =>
    Object.fromEntries(Array.from({ length: count }, (_, n) => [`x${n}`, { say: 'x' }]));
  expect(() => parsed({ a: { jam: languages(16) } })).not.toThrow();
  expect(() => parsed({ a: { jam: languages(17) } })).toThrow(
    'mapping.explain.a.jam: more than 16 languages',
  );
});
