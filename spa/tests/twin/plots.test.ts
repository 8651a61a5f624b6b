import { parseSchema } from '@posecast/wire';
import { beforeEach, describe, expect, it } from 'vitest';
import {
  addTrace,
  clearTraces,
  MOST_TRACES,
  onTraces,
  removeTrace,
  toggleTrace,
  traces,
} from '../../src/app/state/viewing.ts';
import { HISTORY_S, History } from '../../src/twin/plots/history.ts';
import { traceReading } from '../../src/twin/plots/trace.ts';
import { csvOf, plotData, plotGroups, sheetOf } from '../../src/twin/plots/window.ts';
import { codesWith, SCHEMA, stateAt } from '../rigs/schema.ts';

const state = (atMs: number, changed: Parameters<typeof codesWith>[0] = {}) =>
  stateAt(atMs, codesWith(changed));
const read = (field: string, label: string, changed: Parameters<typeof codesWith>[0]) =>
  traceReading(SCHEMA, { field, label })?.read(codesWith(changed));

describe('what can be plotted', () => {
  it('any channel, the error of a joint, and the angles of an attitude', () => {
    expect(read('cur', 'RKN', { 'cur.RKN': 150 })).toBeCloseTo(1.5);
    expect(read('cur', 'RKN', { 'cur.RKN': null })).toBeNull();
    expect(read('error', 'RKN', { 'ref.RKN': 500, 'pos.RKN': -480 })).toBeCloseTo(0.98);
    expect(read('error', 'RKN', { 'ref.RKN': null })).toBeNull();
    expect(read('quat', 'torso.roll', { 'quat.torso.w': 707, 'quat.torso.x': 707 })).toBeCloseTo(Math.PI / 2);
    expect(traceReading(SCHEMA, { field: 'ftf', label: 'RF.fz' })).toMatchObject({
      title: 'right foot Fz',
      unit: 'N',
    });
  });

  it('nothing that the robot does not report, and no flags', () => {
    for (const [field, label] of [
      ['vel', 'RKN'],
      ['pos', 'nobody'],
      ['error', 'nobody'],
      ['flags', 'RKN'],
      ['quat', 'torso.w'],
      ['__proto__', '__proto__'],
    ] as const)
      expect(traceReading(SCHEMA, { field, label }), field).toBeNull();
  });
});

describe('the list', () => {
  beforeEach(clearTraces);

  it('holds each value once, tells of changes, and takes no more than can be told apart', () => {
    let told = 0;
    const leave = onTraces(() => {
      told += 1;
    });
    const value = { field: 'pos', label: 'RKN' };
    addTrace(value);
    addTrace({ ...value });
    expect(traces()).toEqual([value]);
    toggleTrace({ ...value });
    expect(traces()).toEqual([]);
    for (let i = 0; i < 20; i += 1) addTrace({ field: 'pos', label: `${i}` });
    expect(traces()).toHaveLength(MOST_TRACES);
    removeTrace({ field: 'pos', label: '0' });
    expect(traces()[0]?.label).toBe('1');
    expect(told).toBe(2 + MOST_TRACES + 1);
    leave();
  });
});

describe('the picture', () => {
  const history = () => {
    const past = new History();
    for (const [atMs, code] of [
      [0, 100],
      [100, 200],
      [4000, null],
      [4100, 300],
    ] as const) {
      past.push(SCHEMA, state(atMs, { 'pos.RKN': code, 'cur.RKN': 50 }));
    }
    return past;
  };

  it('has a plot for each unit; what is not reported stands last and empty', () => {
    const list = [
      { field: 'gone', label: 'X' },
      { field: 'pos', label: 'RKN' },
      { field: 'cur', label: 'RKN' },
      { field: 'ref', label: 'RKN' },
    ];
    const groups = plotGroups(history(), list, 'deg');
    expect(groups.map(({ display, traces }) => [display.unit, traces.map(({ index }) => index)])).toEqual([
      ['°', [1, 3]],
      ['A', [2]],
      ['', [0]],
    ]);
    expect(plotData(history(), groups[2]!, 5000).columns[0]?.every((value) => value === null)).toBe(true);
  });

  it('breaks a line where frames were missing, and is in the unit that is shown', () => {
    const past = history();
    const [group] = plotGroups(past, [{ field: 'pos', label: 'RKN' }], 'deg');
    const data = plotData(past, group!, 5000);
    expect(data.s).toEqual([-5, -4.9, -2.95, -1, -0.9]);
    const degrees = [5.73, 11.46, null, null, 17.19];
    expect(data.columns[0]).toEqual(degrees.map((d) => (d === null ? null : expect.closeTo(d, 2))));
  });

  it('is of the schema that its frames have, also while a new one has come without any', () => {
    const past = history();
    const other = parseSchema(SCHEMA.text.replace('"joint":["LKN","RKN","NK1"]', '"joint":["A","B","C"]'));
    const list = [{ field: 'pos', label: 'RKN' }];
    expect(plotGroups(past, list, 'rad')[0]?.traces[0]?.reading).not.toBeNull();
    past.push(other, { ...state(6000), schemaId: other.id });
    expect(plotGroups(past, list, 'rad')[0]?.traces[0]?.reading).toBeNull();
  });

  it('can be held while the past goes by', () => {
    const past = history();
    const held = past.copy();
    for (let n = 0; n < 900; n += 1) past.push(SCHEMA, state(5000 + n * 100, { 'pos.RKN': 0 }));
    expect(held.trace('pos', 'RKN', 5000).values).toEqual([0.1, 0.2, null, expect.closeTo(0.3)]);
    expect(past.trace('pos', 'RKN', 95_000).values.every((value) => value === 0)).toBe(true);
  });

  it('never takes more than it took after its first frame', () => {
    const past = new History();
    past.push(SCHEMA, state(0));
    const { bytes } = past;
    for (let n = 1; n < 30 * 300; n += 1) past.push(SCHEMA, state((n * 1000) / 30, { 'pos.RKN': n % 700 }));
    expect(past.bytes).toBe(bytes);
    const [group] = plotGroups(past, [{ field: 'pos', label: 'RKN' }], 'rad');
    expect(plotData(past, group!, 300_000).s.length).toBeLessThanOrEqual(HISTORY_S * 10);
  });
});

describe('as a table', () => {
  it('is what stands between the edges of the plot', () => {
    const past = new History();
    for (let n = 0; n < 5; n += 1)
      past.push(SCHEMA, state(n * 1000, { 'pos.RKN': n * 100, 'cur.RKN': null }));
    const list = [
      { field: 'pos', label: 'RKN' },
      { field: 'cur', label: 'RKN' },
    ];
    const plots = plotGroups(past, list, 'rad').map((group) => ({
      group,
      data: plotData(past, group, 4000),
    }));
    expect(csvOf(sheetOf(plots, -3, -1))).toBe(
      '"time","RKN pos [rad]","RKN cur [A]"\r\n' +
        '1970-01-01T00:00:01.000Z,0.1,\r\n' +
        '1970-01-01T00:00:02.000Z,0.2,\r\n' +
        '1970-01-01T00:00:03.000Z,0.3,\r\n',
    );
  });

  it('takes no name for a formula', () => {
    const titles = ['=1+1', '@x', '-2', 'a "b", c', 'x;=1+1'];
    const columns = titles.map((title) => ({ title, unit: '', values: [] }));
    expect(csvOf({ atMs: [], columns })).toBe(`"time","'=1+1","'@x","'-2","a ""b"", c","x;'=1+1"\r\n`);
  });
});
