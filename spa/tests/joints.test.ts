import { describe, expect, it } from 'vitest';
import { JointTable } from '../src/twin/joints.ts';
import { codesWith, SCHEMA } from './schema.ts';

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

  it('show reference, position, their difference, current, temperature and plain name', () => {
    const knee = row({ 'ref.RKN': 500, 'pos.RKN': 480, 'cur.RKN': -150 });
    expect(knee.ref).toBeCloseTo(0.5);
    expect(knee.pos).toBeCloseTo(0.48);
    expect(knee.error).toBeCloseTo(0.02);
    expect(knee.cur).toBeCloseTo(-1.5);
    expect(knee).toMatchObject({ temp: 33, homed: true, enabled: true, plain: 'right knee', level: 'ok' });
  });

  it('have null for no reading, also in what is derived from it', () => {
    expect(row({ 'pos.RKN': null, 'temp.RKN': null, 'flags.RKN': null })).toMatchObject({
      pos: null,
      error: null,
      temp: null,
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
    expect(row({ 'temp.RKN': 57 })).toMatchObject({ level: 'caution', tempLevel: 'caution' });
    expect(row({ 'temp.RKN': 71 })).toMatchObject({ level: 'fault', tempLevel: 'fault' });
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
    expect(first[0]?.pos).toBeCloseTo(0.007);
  });

  it('know which columns a robot has', () => {
    const table = new JointTable(SCHEMA);
    const columns = ['ref', 'pos', 'error', 'cur', 'temp', 'flags', 'homed', 'enabled'] as const;
    expect(columns.every((column) => table.has(column))).toBe(true);
  });
});
