import { describe, expect, it } from 'vitest';
import { CROSSING_LIMIT, LimitLog } from '../../src/twin/alarms/limit_log.ts';
import { type Threshold, ValueLimits, withEdit } from '../../src/twin/limits.ts';
import { SensorTable } from '../../src/twin/sensors/sensors.ts';
import { codesWith, SCHEMA } from '../rigs/schema.ts';

const OWN: Threshold = { low: -50, high: 300, caution: 0.8 };

function watched(threshold: Threshold | null = OWN) {
  const table = new SensorTable(SCHEMA);
  const log = new LimitLog();
  const edits = threshold === null ? new Map() : withEdit(new Map(), 'ftf', 'RF.fz', threshold);
  const limits = new ValueLimits(SCHEMA.mapping, edits);
  const look = (newtons: number | null, atMs: number, by = limits) =>
    log.look(table.read(codesWith({ 'ftf.RF.fz': newtons }), by), by, atMs);
  const told = () =>
    log.crossings.map(
      ({ atMs, source, side, limit, state }) => `${atMs} ${source} ${side} ${limit} ${state}`,
    );
  return { log, look, told };
}

describe("what the viewer's own limits see", () => {
  it('is told when a reading goes past one, and when it is well back', () => {
    const { look, told } = watched();
    expect([look(100, 1), look(310, 2), look(350, 3), look(295, 4), look(200, 5), look(-60, 6)]).toEqual([
      false,
      true,
      false,
      false,
      true,
      true,
    ]);
    expect(told()).toEqual([
      '2 right foot Fz above 300 N on',
      '5 right foot Fz above 300 N off',
      '6 right foot Fz below -50 N on',
    ]);
  });

  it('is nothing new while there is no reading, and nothing at all by the limits of the profile', () => {
    const { look, told } = watched();
    look(310, 1);
    expect([look(null, 2), look(310, 3)]).toEqual([false, false]);
    expect(told()).toHaveLength(1);
    const profile = watched(null);
    expect(profile.look(9999, 1)).toBe(false);
  });

  it('is forgotten when the limit goes back to the profile', () => {
    const { look, told } = watched();
    look(310, 1);
    expect(look(310, 2, new ValueLimits(SCHEMA.mapping))).toBe(false);
    look(310, 3);
    expect(told()).toHaveLength(2);
  });

  it('takes bounded room, and goes on telling when it is full', () => {
    const { log, look } = watched();
    for (let n = 0; n < 1000; n += 1) expect(look(n % 2 === 0 ? 400 : 0, n)).toBe(true);
    expect(log.crossings).toHaveLength(CROSSING_LIMIT);
    expect(log.crossings.at(-1)?.n).toBe(1000);
  });

  it('is told also of what the page computes, by whoever’s limit it is', () => {
    const log = new LimitLog();
    const margin = (value: number | null, level: 'ok' | 'fault', own = false) =>
      log.note(
        'Balance',
        { field: 'balance', label: 'margin', name: 'margin', unit: 'mm', value, level },
        { low: 0, high: null, caution: 1 },
        5,
        own,
      );
    margin(30, 'ok');
    margin(-2, 'fault');
    margin(null, 'ok');
    margin(25, 'ok');
    expect(
      log.crossings.map(({ source, side, limit, state, own }) => [source, side, limit, state, own]),
    ).toEqual([
      ['Balance margin', 'below', '0 mm', 'on', false],
      ['Balance margin', 'below', '0 mm', 'off', false],
    ]);
  });
});
