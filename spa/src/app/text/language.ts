import { useSyncExternalStore } from 'react';
import { LatePart } from '../../browser/late_part.ts';
import { createStore } from '../../kit.ts';
import { onSettings, type Settings, settings } from '../state/settings.ts';
import { en, type Text } from './en.ts';

type Language = Exclude<Settings['language'], 'system'>;
type Korean = typeof import('./ko.ts');

const KOREAN = new LatePart(
  () => import('./ko.ts'),
  () => false, // only for who reads it
);

/** The loaded Korean sentences; null while the page is in English. */
const inForce = createStore<Korean | null>(null);
let wanted: Language = 'en';

/** The sentences of `en.ts`, in the language in force. For code outside components; in a component use `useText`. */
export function say(): Text {
  return inForce.get()?.ko ?? en;
}

/** The loaded Korean sentences; null while the page is in English. */
export const korean = inForce.get;
/** The tag of the language in force. */
export function languageTag(): Language {
  return inForce.get() === null ? 'en' : 'ko';
}

/** Adds a listener for changes of the language in force. Returns a function that removes it. */
export const onLanguage = inForce.subscribe;

/** The sentences of `en.ts`, in the language in force, for a component. It is drawn again when the language changes. */
export function useText(): Text {
  return useSyncExternalStore(onLanguage, say);
}

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
