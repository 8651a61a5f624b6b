import { expect, test } from 'vitest';
import { visible } from '../src/index.ts';

test('what is to be seen stays as it is', () => {
  for (const text of ['', 'RKN 2', 'Übung', '오른 무릎', 'אבג', '🦿', '\\u{0}'])
    expect(visible(text)).toBe(text);
});

test('what nobody sees, or what turns others, is escaped', () => {
  const unseen = [
    ...'\0\x1f\x7f\u00a0\u00ad\u034f\u115f\u200b\u200f\u202e\u2028\u2069\u2800\u3000\u3164\ufe0f\ufeff',
  ];
  for (const letter of [...unseen, '\u{e0041}', '\ud800'])
    expect(visible(`a${letter}b`)).toBe(`a\\u{${letter.codePointAt(0)!.toString(16)}}b`);
});
