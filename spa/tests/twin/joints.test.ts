import { describe, expect, it } from 'vitest';
import { JointTable } from '../../src/twin/joints.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

const HOMED = 1;
const ENABLED = 2;
const JAM = 4;
const PWM = 8;
const COMPLY = 16;

const row = (changed: Parameters<typeof codesWith>[0], label = 'RKN') => {
  const found = new JointTable(SCHEMA).read(codesWith(changed)).find((r) => r.label === label);
  if (found === undefined) throw new Error(label);
  return found;
};

/** The columns of the right knee. */
const numbers = (changed: Parameters<typeof codesWith>[0]) => {
  const table = new JointTable(SCHEMA);
  const at = table.read(codesWith(changed)).findIndex((r) => r.label === 'RKN');
  return Object.fromEntries(Object.entries(table.numbers).map(([name, column]) => [name, column[at]!]));
};

describe('joint rows', () => {
  it('of a joint that yields on purpose are no caution for it', () => {
    expect(row({ 'ref.RKN': 500, 'flags.RKN': HOMED | ENABLED })).toMatchObject({
      apart: true,
      level: 'caution',
    });
    expect(row({ 'ref.RKN': 500, 'flags.RKN': HOMED | ENABLED | COMPLY })).toMatchObject({
      ...{ apart: false, compliant: true, level: 'ok' },
    });
  });

  it('have reference, position, their difference, current and temperature', () => {
    const changed = { 'ref.RKN': 500, 'pos.RKN': 480, 'cur.RKN': -150 };
    const knee = numbers(changed);
    expect(knee.ref).toBeCloseTo(0.5);
    expect(knee.pos).toBeCloseTo(0.48);
    expect(knee.error).toBeCloseTo(0.02);
    expect(knee.cur).toBeCloseTo(-1.5);
    expect(knee.temp).toBe(33);
    expect(row(changed)).toMatchObject({ homed: true, enabled: true, level: 'ok' });
  });

  it('have NaN or null for no reading, also in what is derived from it', () => {
    const nothing = { 'pos.RKN': null, 'temp.RKN': null, 'flags.RKN': null };
    expect(numbers(nothing)).toMatchObject({ ref: 0, pos: Number.NaN, error: Number.NaN, temp: Number.NaN });
    expect(row(nothing)).toMatchObject({
      homed: null,
      enabled: null,
      flags: [],
      level: 'ok',
    });
  });

  it('name flags, the worst first; homed and enabled stand in columns of their own', () => {
    const knee = row({ 'flags.RKN': ENABLED | COMPLY | PWM | JAM });
    expect(knee.flags.map((flag) => [flag.words, flag.severity])).toEqual([
      ['jam', 'fault'],
      ['PWM saturated', 'caution'],
      ['comply', 'state'],
    ]);
    expect(knee).toMatchObject({ homed: false, enabled: true, level: 'fault' });
  });

  it('take their level from the worst of flags, limits and tolerance', () => {
    expect(row({ 'flags.RKN': HOMED | PWM }).level).toBe('caution');
    expect(row({ 'flags.RKN': HOMED | COMPLY }).level).toBe('ok');
    expect(row({ 'temp.RKN': 57 })).toMatchObject({ level: 'caution', levels: { temp: 'caution' } });
    expect(row({ 'temp.RKN': 71 })).toMatchObject({ level: 'fault', levels: { temp: 'fault' } });
    expect(row({ 'ref.RKN': 51 })).toMatchObject({ level: 'caution', apart: true });
    expect(row({ 'ref.RKN': 49 })).toMatchObject({ level: 'ok', apart: false });
  });

  it('count a bit that nobody named as a fault', () => {
    const knee = row({ 'flags.RKN': HOMED | (1 << 9) });
    expect(knee.flags.map((flag) => flag.words)).toEqual(['bit 9']);
    expect(knee.level).toBe('fault');
  });

  it('are rewritten in place', () => {
    const table = new JointTable(SCHEMA);
    const first = table.read(codesWith());
    expect(table.read(codesWith({ 'pos.LKN': 7 }))).toBe(first);
    expect(table.numbers.pos[0]).toBeCloseTo(0.007);
  });

  it('count their changes, those of numbers apart', () => {
    const table = new JointTable(SCHEMA);
    const knee = SCHEMA.field('pos')!.labels.indexOf('RKN');
    table.read(codesWith());
    const before = [...table.changes];
    table.read(codesWith({ 'pos.RKN': 7, 'cur.RKN': 30 }));
    expect([...table.changes]).toEqual(before);
    for (const change of [{ 'flags.RKN': JAM }, { 'pos.RKN': 400 }, { 'temp.RKN': 71 }, {}]) {
      const counted = table.changes[knee]!;
      table.read(codesWith(change));
      expect(table.changes[knee], JSON.stringify(change)).toBe(counted + 1);
    }
    expect(table.changes[0]).toBe(before[0]);
  });

  it('know which columns a robot has', () => {
    const table = new JointTable(SCHEMA);
    const columns = ['ref', 'pos', 'error', 'cur', 'temp', 'flags', 'homed', 'enabled'] as const;
    expect(columns.every((column) => table.has(column))).toBe(true);
  });
});
