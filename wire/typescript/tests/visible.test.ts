import { expect, test } from 'vitest';
import { visible } from '../src/index.ts';
import { load } from './vectors.ts';

const { cases } = load<{ cases: readonly { text: string; shown: string }[] }>('vectors/visible.json');

test.each(cases)('what is shown of $text', ({ text, shown }) => {
  expect(visible(text)).toBe(shown);
});

test('half a pair is escaped', () => {
  expect(visible('a\ud800b')).toBe('a\\u{d800}b');
});
