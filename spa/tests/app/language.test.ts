import { afterEach, expect, it } from 'vitest';
import { en } from '../../src/app/text/en.ts';
import * as korean from '../../src/app/text/ko.ts';
import { say, wantedLanguage } from '../../src/app/text/language.ts';
import * as late from '../../src/app/text/late_en.ts';
import { moreEn } from '../../src/app/text/more_en.ts';
import { SIGNS } from '../../src/scene/signs/signs.ts';

afterEach(() => {
  expect(say(), 'a test changes no language').toBe(en);
});

const signNames = (tag: 'en' | 'ko') =>
  Object.fromEntries(SIGNS.flatMap(({ key, menu }) => (menu === undefined ? [] : [[key, menu.name[tag]]])));

it.each([
  ['of the first second', en, korean.ko],
  ['of the rest', moreEn, korean.moreKo],
  ['of the past', late.pastEn, korean.pastKo],
  ['of moments', late.momentsEn, korean.momentsKo],
  ['of recordings', late.recordingEn, korean.recordingKo],
  ['of balance', late.balanceEn, korean.balanceKo],
  ['of accounts', late.accountEn, korean.accountKo],
  ['of signs', signNames('en'), signNames('ko')],
])(
  'has the same sentences in English and Korean, with the same gaps to fill: %s',
  (_, english, translation) => {
    expect(Object.keys(translation).sort()).toEqual(Object.keys(english).sort());
    for (const [key, said] of Object.entries<unknown>(english)) {
      const translated: unknown = translation[key as keyof typeof translation];
      if (typeof said === 'function' && typeof translated === 'function') {
        expect(translated.length, key).toBe(said.length);
        const gaps = Array.from({ length: said.length }, (_unused, i) =>
          key === 'noReadingOf' && i === 0 ? ['§0'] : `§${i}`,
        );
        for (const gap of gaps.flat()) {
          if (said(...gaps).includes(gap)) expect(translated(...gaps), key).toContain(gap);
        }
      } else {
        expect(typeof translated, key).toBe('string');
        expect(translated, `${key} is left in English`).not.toBe(said);
      }
    }
  },
);

it('is the one that was chosen, else the first of the browser’s that the page speaks', () => {
  expect(wantedLanguage('ko', ['en'])).toBe('ko');
  expect(wantedLanguage('en', ['ko-KR'])).toBe('en');
  expect(wantedLanguage('system', ['ko-KR', 'en'])).toBe('ko');
  expect(wantedLanguage('system', ['de', 'KO', 'en'])).toBe('ko');
  expect(wantedLanguage('system', ['de', 'en-GB', 'ko'])).toBe('en');
  expect(wantedLanguage('system', ['fr'])).toBe('en');
  expect(wantedLanguage('system', [])).toBe('en');
});
