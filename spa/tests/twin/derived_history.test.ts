import { parseSchema } from '@posecast/wire';
import { expect, it, vi } from 'vitest';
import { COMPUTED_AT_ONCE, DerivedHistory } from '../../src/twin/plots/derived_history.ts';
import { History } from '../../src/twin/plots/history.ts';
import { plotData, plotGroups, sheetOf } from '../../src/twin/plots/window.ts';
import { codesWith, SCHEMA, SCHEMA_TEXT } from '../rigs/schema.ts';

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
