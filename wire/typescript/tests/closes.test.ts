import { expect, test } from 'vitest';
import { Close, ENDINGS, retryOf } from '../src/index.ts';
import { load } from './vectors.ts';

interface Row {
  readonly code: number;
  readonly key: string;
  readonly name: string;
  readonly meaning: string;
  readonly retry: string;
}

test('the table is closes.json', () => {
  const keys = new Map<number, string>(Object.entries(Close).map(([key, code]) => [code, key]));
  const table = [...ENDINGS].map(([code, ending]) => ({ code, key: keys.get(code), ...ending }));
  expect(table).toEqual(load<Row[]>('closes.json'));
});

test('an unknown ending is worth another try', () => {
  expect([1000, 1006, 4999].map(retryOf)).toEqual(['backoff', 'backoff', 'backoff']);
  expect(retryOf(4403)).toBe('never');
});
