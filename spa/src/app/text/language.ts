import { useSyncExternalStore } from 'react';
import { createStore } from '../../browser/store.ts';
import { onSettings, type Settings, settings } from '../state/settings.ts';
import { en, type Text } from './en.ts';

type Language = Exclude<Settings['language'], 'system'>;
type Korean = typeof import('./ko.ts');

/** null: the page speaks English. */
const inForce = createStore<Korean | null>(null);
let wanted: Language = 'en';

/** The page's sentences, in the language in force. */
export function say(): Text {
  return inForce.get()?.ko ?? en;
}

export const korean = inForce.get;
export const onLanguage = inForce.subscribe;

/** The same in a component, which is drawn again when the language changes. */
export function useText(): Text {
  return useSyncExternalStore(onLanguage, say);
}

/** The person's choice, else the first language of the browser that the page knows. */
export function wantedLanguage(chosen: Settings['language'], browser: readonly string[]): Language {
  if (chosen !== 'system') return chosen;
  const tags = browser.map((tag) => tag.toLowerCase().split('-')[0]);
  return tags.find((tag) => tag === 'en' || tag === 'ko') === 'ko' ? 'ko' : 'en';
}

/** Speaks the wanted language from now on, and any that is chosen later. A catalogue that does not come changes nothing. */
export async function bindLanguage(): Promise<void> {
  onSettings(() => void become());
  await become();
}

async function become(): Promise<void> {
  const now = wantedLanguage(settings().language, navigator.languages);
  if (now === wanted) return;
  wanted = now;
  const found = now === 'ko' ? await import('./ko.ts').catch(() => null) : null;
  if (wanted !== now) return; // chosen otherwise meanwhile
  document.documentElement.lang = found === null ? 'en' : 'ko';
  inForce.set(found);
}
