import { expect, test } from 'vitest';
import { readable, visible } from '../src/index.ts';

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

test('what people read keeps the joiners and marks of its script', () => {
  for (const text of ['نیم\u200cساق', 'ශ්\u200dරී', '\u200eB\u200f']) expect(readable(text)).toBe(text);
  for (const letter of '\0\u00ad\u061c\u200b\u202a\u202e\u2066\u2069\u2028\ufeff')
    expect(readable(`a\u200c${letter}`)).toBe(`a\u200c\\u{${letter.codePointAt(0)!.toString(16)}}`);
});
