import { describe, expect, test } from 'vitest';
import { parseSchema, readBalance } from '../src/index.ts';

const SOLE = [
  [0, 0, 0],
  [1, 0, 0],
  [0, 1, 0],
];

function read(mapping: unknown) {
  const fields = [{ name: 'pos', labels: 'joint' }];
  const doc = { type: 'schema', v: 1, robot: 'r', labels: { joint: ['J'] }, fields, mapping };
  return readBalance(parseSchema(JSON.stringify(doc)));
}

test('what the robot stands on', () => {
  expect(read({ balance: { feet: ['RF'], ground: 'measured', soles: { RF: SOLE } } })).toEqual({
    feet: ['RF'],
    ground: 'measured',
    soles: new Map([['RF', SOLE]]),
  });
  const silent = { feet: null, ground: null, soles: new Map() };
  expect(read(undefined)).toEqual(silent);
  expect(read({ balance: null })).toEqual(silent);
  expect(read({ balance: { feet: [], later: 1 } })).toEqual({ ...silent, feet: [] });
});

describe('what is none is named as in Python', () => {
  const seventeen = [...Array(17).keys()].map(String);
  test.each([
    [[], 'mapping.balance: must be an object'],
    [{ feet: 'RF' }, 'mapping.balance.feet: must be a list'],
    [{ feet: ['RF', 'RF'] }, "mapping.balance.feet: 'RF' appears twice"],
    [{ feet: seventeen }, 'mapping.balance.feet: more than 16 names'],
    [{ ground: 'air' }, 'mapping.balance.ground: must be one of measured, lowest'],
    [{ ground: ['lowest'] }, 'mapping.balance.ground: must be one of measured, lowest'],
    [{ soles: { RF: SOLE.slice(1) } }, 'mapping.balance.soles.RF: must have 3 to 64 corners'],
    [{ soles: { RF: [...SOLE, [0, 0]] } }, 'mapping.balance.soles.RF[3]: must be three numbers'],
    [{ soles: { RF: [...SOLE, [0, 0, '0']] } }, 'mapping.balance.soles.RF[3][2]: must be a number'],
    [
      { soles: Object.fromEntries(seventeen.map((foot) => [foot, SOLE])) },
      'mapping.balance.soles: more than 16 soles',
    ],
  ])('%j', (balance, words) => {
    expect(() => read({ balance })).toThrow(words);
  });
});
