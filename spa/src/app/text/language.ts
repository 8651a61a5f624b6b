import { useSyncExternalStore } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import { createStore } from '../../kit.ts';
import { onSettings, type Settings, settings } from '../state/settings.ts';
import { en } from './en.ts';
import { type More, moreEn } from './more_en.ts';

export type { More };

type Language = Exclude<Settings['language'], 'system'>;
type Korean = typeof import('./ko.ts');

const KOREAN = new LatePart(
  () => import('./ko.ts'),
  () => false, // only for who reads it
);

/** The loaded Korean sentences; null while the page is in English. */
const inForce = createStore<Korean | null>(null);
let wanted: Language = 'en';

/** The loaded Korean sentences; null while the page is in English. */
export const korean = inForce.get;
/** The tag of the language in force. */
export function languageTag(): Language {
  return inForce.get() === null ? 'en' : 'ko';
}

/** Adds a listener for changes of the language in force. Returns a function that removes it. */
export const onLanguage = inForce.subscribe;

/** A table of sentences, in English and in Korean: returns it in the language in force, for code outside components, and for a
 *  component, which is drawn again when the language changes. */
export function texts<T>(english: T, ofKorean: (korean: Korean) => T): [say: () => T, useSaid: () => T] {
  const said = () => {
    const found = korean();
    return found === null ? english : ofKorean(found);
  };
  return [said, () => useSyncExternalStore(onLanguage, said)];
}

/** The sentences of `en.ts`: what the first picture needs. */
export const [say, useText] = texts(en, ({ ko }) => ko);
/** The sentences of `more_en.ts`: of the parts that come after it. */
export const [more, useMore] = texts(moreEn, ({ moreKo }) => moreKo);

/** The language to use: the person's choice; for `system` the first of the browser's language tags that is English or
 *  Korean, or English if there is none. */
export function wantedLanguage(chosen: Settings['language'], browser: readonly string[]): Language {
  if (chosen !== 'system') return chosen;
  const tags = browser.map((tag) => tag.toLowerCase().split('-')[0]);
  return tags.find((tag) => tag === 'en' || tag === 'ko') === 'ko' ? 'ko' : 'en';
}

/** Puts the wanted language in force, now and whenever the setting changes. If the Korean sentences can't be loaded, the
 *  page is in English until they have come. */
export async function bindLanguage(): Promise<void> {
  onSettings(() => void become());
  await become();
}

async function become(): Promise<void> {
  const now = wantedLanguage(settings().language, navigator.languages);
  if (now === wanted) return;
  wanted = now;
  if (now === 'ko' && !(await KOREAN.attempt())) void KOREAN.load().then(() => putInForce('ko'));
  putInForce(now);
}

function putInForce(language: Language): void {
  if (wanted !== language) return; // another was chosen meanwhile
  const found = language === 'ko' ? KOREAN.value() : null;
  document.documentElement.lang = found === null ? 'en' : 'ko';
  inForce.set(found);
}
