import { parseSchema } from '@posecast/wire';
import { describe, expect, it, vi } from 'vitest';
import { COMPUTED_AT_ONCE, DerivedHistory, HISTORY_S, History } from '../../src/twin/plots/history.ts';
import { strip } from '../../src/twin/plots/sparkline.ts';
import { plotData, plotGroups, sheetOf } from '../../src/twin/plots/window.ts';
import { codesWith, SCHEMA, SCHEMA_TEXT, stateAt } from '../rigs/schema.ts';

const state = (atMs: number, changed: Parameters<typeof codesWith>[0] = {}) =>
  stateAt(atMs, codesWith(changed));

describe('the last minute', () => {
  it('of one channel, oldest first', () => {
    const history = new History();
    for (const [atMs, code] of [
      [0, 100],
      [100, null],
      [200, 300],
    ] as const) {
      history.push(SCHEMA, state(atMs, { 'pos.RKN': code }));
    }
    expect(history.trace('pos', 'RKN', 1200)).toEqual({ agoS: [-1.2, -1.1, -1], values: [0.1, null, 0.3] });
    expect(history.trace('pos', 'nobody', 1200).values).toEqual([]);
    expect(history.trace('vel', 'RKN', 1200).values).toEqual([]);
  });

  it('takes ten a second at most, and forgets what is older than a minute', () => {
    const history = new History();
    for (let n = 0; n < 30 * 90; n += 1) history.push(SCHEMA, state((n * 1000) / 30, { 'pos.RKN': n }));
    const { agoS } = history.trace('pos', 'RKN', 90_000);
    expect(agoS.length).toBeLessThanOrEqual(HISTORY_S * 10);
    expect(agoS.length).toBeGreaterThan(HISTORY_S * 7);
    expect(Math.min(...agoS)).toBeGreaterThanOrEqual(-HISTORY_S);
  });

  it('begins anew with another schema', () => {
    const history = new History();
    history.push(SCHEMA, state(0, {}));
    const other = parseSchema(SCHEMA.text.replace('"Small"', '"Other"'));
    history.push(other, { ...state(100, {}), schemaId: other.id });
    expect(history.trace('pos', 'RKN', 200).agoS).toEqual([-0.1]);
  });
});

describe('a strip', () => {
  it('has all traces on one scale', () => {
    const found = strip(
      [
        { agoS: [-10, 0], values: [0, 1] },
        { agoS: [-5, -4], values: [0.5, 0.5] },
      ],
      ...([100, 20, 10, 0.1] as const),
    );
    expect(found).toEqual({ paths: ['M0 20M100 0', 'M50 10L60 10'], low: 0, high: 1 });
  });

  it('breaks where there was no reading, and keeps a flat line flat', () => {
    const found = strip([{ agoS: [-3, -2, -1, 0], values: [1, null, 1, 1.2] }], 90, 10, 3, 1);
    expect(found?.paths).toEqual(['M0 6M60 6L90 4']);
    expect(found).toMatchObject({ low: expect.closeTo(0.6), high: expect.closeTo(1.6) });
    expect(strip([{ agoS: [0], values: [null] }], 90, 10, 3, 1)).toBeNull();
    const around = strip([{ agoS: [-1, 0, 1], values: [0, 1, 0] }], 90, 10, 2, 1, 1);
    expect(around?.paths).toEqual(['M0 10L45 0L90 10']);
  });
});

const knee = (code: number) => codesWith({ 'pos.RKN': code });
const RKN = SCHEMA.field('pos')!.start + 1;

/** A history of this many states, ten a second starting at `fromMs`; the knee's value is the index of the state. */
function recorded(count: number, fromMs = 0): History {
  const history = new History();
  for (let i = 0; i < count; i += 1) history.push(SCHEMA, { codes: knee(i), atMs: fromMs + i * 100 });
  return history;
}

function derived() {
  const compute = vi.fn((codes: Int32Array, _atMs: number, into: Float64Array) => {
    into[0] = codes[RKN]! * 2;
    if (codes[RKN]! % 2 === 0) into[1] = 1;
  });
  return { compute, of: new DerivedHistory(SCHEMA, 2, compute) };
}

it('computes each state once, a few at a time, the newest first and in the order of time', () => {
  const history = recorded(200);
  const { compute, of } = derived();
  expect(of.update(history, 19_900)).toBe(true);
  expect(compute).toHaveBeenCalledTimes(COMPUTED_AT_ONCE);
  const times = compute.mock.calls.map(([, atMs]) => atMs);
  expect([times[0], times.at(-1)]).toEqual([14_000, 19_900]);
  expect([of.value(0, 19_900), of.value(0, 100)], 'what is to come is null').toEqual([398, null]);
  while (of.update(history, 19_900));
  expect(compute).toHaveBeenCalledTimes(200);
  expect(of.value(0, 100)).toBe(2);
  history.push(SCHEMA, { codes: knee(7), atMs: 20_000 });
  expect(of.update(history, 20_000)).toBe(false);
  expect(compute, 'one frame more').toHaveBeenCalledTimes(201);
});

it('what is none is null', () => {
  const { of } = derived();
  of.update(recorded(2), 100);
  expect([of.value(1, 0), of.value(1, 100), of.value(0, 77)]).toEqual([1, null, null]);
});

it('is bounded: what has left the minute goes, however long it runs', () => {
  const history = recorded(1);
  const { of } = derived();
  for (let i = 1; i < 5000; i += 1) {
    history.push(SCHEMA, { codes: knee(i), atMs: i * 100 });
    of.update(history, i * 100);
  }
  expect(of.size).toBeLessThanOrEqual(901);
  expect(of.value(0, 4999 * 100 - 59_000), 'within the minute').not.toBeNull();
});

it('of another schema nothing is computed', () => {
  const { compute, of } = derived();
  const other = parseSchema(SCHEMA_TEXT.replace('"Small"', '"Other"'));
  const history = new History();
  history.push(other, { codes: codesWith({}), atMs: 0 });
  expect(of.update(history, 0)).toBe(false);
  expect(compute).not.toHaveBeenCalled();
});

it('is plotted and saved beside what the robot reports', () => {
  const history = recorded(30);
  const { of } = derived();
  const traces = {
    reading: ({ field, label }: { field: string; label: string }) =>
      field !== 'balance' || label !== 'margin'
        ? null
        : {
            ...{ title: 'Balance: margin', unit: 'mm', scale: 0.1, ofJoint: false },
            read: (_: Int32Array, atMs = Number.NaN) => of.value(0, atMs),
          },
    update: (past: History, nowMs: number) => of.update(past, nowMs),
  };
  const list = [
    { field: 'balance', label: 'margin' },
    { field: 'pos', label: 'RKN' },
    { field: 'balance', label: 'nothing' },
  ];
  const groups = plotGroups(history, list, 'rad', undefined, traces);
  expect(groups.map(({ display }) => display.unit)).toEqual(['mm', 'rad', '']);
  traces.update(history, 2900);
  const plots = groups.map((group) => ({ group, data: plotData(history, group, 2900) }));
  const sheet = sheetOf(plots, -60, 0);
  expect(sheet.columns.map(({ title, unit, values }) => [title, unit, values.at(-1)])).toEqual([
    ['Balance: margin', 'mm', 58],
    ['RKN pos', 'rad', 0.029],
    ['nothing balance', '', null],
  ]);
});
